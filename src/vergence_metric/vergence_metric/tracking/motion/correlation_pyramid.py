"""Dense matching of a region between the eyes by pyramids of correlations.

After Ding, Yan and We (2021, doi 10.3390/ijgi10040234) and Revaud et al., "DeepMatching" (2016): patches of 4 by 4 px
are correlated with every place of the epipolar band; four of them together make a patch of twice the size, whose
correlation is the mean of the best that each of its parts finds within a pixel, rectified by a power. From the top down
each patch adds to its parts what it has found. A match counts if the other eye's patch matches back.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import parabola
from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image

Scores = NDArray[np.float32]

_PATCH_PX = 4
_LEVELS = 3
_POWER = 1.4
_LEAST_CONTRAST = 2.5  # grey levels, standard deviation in a patch
_RETURNS_PX = 1.5


@dataclass(frozen=True)
class RegionMatches:
    """Matches of points (N, 2) [px] of the left image: disparities `across_px`, `down_px` (N,) at its scale."""

    points_px: NDArray[np.float64]
    across_px: NDArray[np.float64]
    down_px: NDArray[np.float64]


def match_region(
    left: Image, right: Image, mask: NDArray[np.bool_], across_px: tuple[int, int], down_px: int
) -> RegionMatches:
    """Match the inside of a mask (h, w) of the left image.

    Args:
        left: (h, w) grey image of the left eye.
        right: (h, w) grey image of the right eye, aligned.
        mask: what is to be matched.
        across_px: least and largest horizontal disparity.
        down_px: largest vertical disparity, either way.

    """
    ys, xs = np.nonzero(mask)
    if not len(xs):
        return RegionMatches(np.empty((0, 2)), np.empty(0), np.empty(0))
    origin = (int(xs.min()), int(ys.min()))
    grid = (-(-(int(ys.max()) + 1 - origin[1]) // _PATCH_PX), -(-(int(xs.max()) + 1 - origin[0]) // _PATCH_PX))
    across, down = _match(left, right, origin, grid, across_px, down_px)
    rows, columns = np.mgrid[0 : grid[0], 0 : grid[1]]
    x, y = origin[0] + _PATCH_PX * columns, origin[1] + _PATCH_PX * rows
    middle = _PATCH_PX // 2
    inside = mask[np.minimum(y + middle, mask.shape[0] - 1), np.minimum(x + middle, mask.shape[1] - 1)]
    good = inside & np.isfinite(across)
    # Back from the right eye: a grid of its own, over all that was matched.
    if good.any():
        x_right = x - across
        low, high = int(np.floor(x_right[good].min())), int(np.ceil(x_right[good].max()))
        start = (low, origin[1] - down_px)
        back_grid = (grid[0] + 2, -(-(high - low + _PATCH_PX) // _PATCH_PX))
        back, _ = _match(right, left, start, back_grid, (-across_px[1], -across_px[0]), down_px)
        j = np.clip(np.rint((y - np.nan_to_num(down) - start[1]) / _PATCH_PX), 0, back_grid[0] - 1).astype(int)
        i = np.clip(np.rint((np.nan_to_num(x_right, nan=low) - start[0]) / _PATCH_PX), 0, back_grid[1] - 1).astype(int)
        good &= np.abs(back[j, i] + across) <= _RETURNS_PX
    center = 0.5 * (_PATCH_PX - 1)
    points = np.column_stack([x[good] + center, y[good] + center]).astype(np.float64)
    return RegionMatches(points, across[good], down[good])


def _match(
    source: Image, other: Image, origin: tuple[int, int], grid: tuple[int, int], d_range: tuple[int, int], v_most: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the disparities (rows, columns) of a grid of patches, NaN where there is no texture."""
    scores = _correlations(source, other, origin, grid, d_range, v_most)
    textured = scores.max(axis=(2, 3)) > 0.0
    levels = [scores]
    for level in range(_LEVELS - 1):
        step = 2**level
        pooled = _pooled(levels[-1])
        parts = [_shifted(pooled, a * step, b * step) for a in (0, 1) for b in (0, 1)]
        levels.append(np.power(np.mean(parts, axis=0), _POWER).astype(np.float32))
    total = levels[-1]
    for level in range(_LEVELS - 2, -1, -1):
        step, wholes = 2**level, _pooled(total)
        best = np.max([_shifted(wholes, -a * step, -b * step) for a in (0, 1) for b in (0, 1)], axis=0)
        total = levels[level] + best
    rows, columns, _, horizontal = total.shape
    flat = total.reshape(rows, columns, -1)
    v, d = np.divmod(flat.argmax(axis=2), horizontal)
    across = (d + d_range[0]).astype(np.float64)
    for j, i in zip(*np.nonzero((d > 0) & (d < horizontal - 1)), strict=True):
        line = scores[j, i, v[j, i], d[j, i] - 1 : d[j, i] + 2]
        across[j, i] += parabola(*line)
    across[~textured] = np.nan
    return across, np.where(textured, v - v_most, np.nan)


def _correlations(
    source: Image, other: Image, origin: tuple[int, int], grid: tuple[int, int], d_range: tuple[int, int], v_most: int
) -> Scores:
    """Return the rectified correlations (rows, columns, vertical, horizontal) of every patch with its band."""
    rows, columns = grid
    size = (_PATCH_PX * columns, _PATCH_PX * rows)
    count = d_range[1] - d_range[0] + 1
    own = _patches(cut(source, *origin, *size))[::_PATCH_PX, ::_PATCH_PX]
    band = cut(other, origin[0] - d_range[1], origin[1] - v_most, size[0] + count - 1, size[1] + 2 * v_most)
    theirs = _patches(band)
    # Disparity d is at column x - d: the largest one first.
    places = _PATCH_PX * np.arange(columns)[:, None] + np.arange(count - 1, -1, -1)[None, :]
    scores = np.empty((rows, columns, 2 * v_most + 1, count), np.float32)
    for v in range(-v_most, v_most + 1):
        lines = theirs[v_most - v :: _PATCH_PX][:rows]
        for row in range(rows):
            scores[row, :, v + v_most] = np.einsum("cp,cdp->cd", own[row], lines[row][places])
    return np.power(np.maximum(scores, 0.0), _POWER)


def _patches(image: Image) -> Scores:
    """Return the patch below and right of every pixel (h - 3, w - 3, 16), without mean and of unit length."""
    windows = np.lib.stride_tricks.sliding_window_view(image.astype(np.float32), (_PATCH_PX, _PATCH_PX))
    flat = windows.reshape(*windows.shape[:2], -1).copy()
    flat -= flat.mean(axis=2, keepdims=True)
    length = np.sqrt(np.einsum("hwp,hwp->hw", flat, flat))[:, :, None]
    flat /= np.maximum(length, 1e-6)
    return np.where(length < _LEAST_CONTRAST * _PATCH_PX, np.float32(0.0), flat)


def _pooled(scores: Scores) -> Scores:
    """Return the largest score within a pixel of every displacement."""
    rows, columns, vertical, horizontal = scores.shape
    flat = scores.reshape(rows * columns * vertical, horizontal)
    across = cv2.dilate(flat, np.ones((1, 3), np.uint8)).reshape(rows, columns, vertical, horizontal)
    padded = np.pad(across, ((0, 0), (0, 0), (1, 1), (0, 0)), mode="edge")
    return np.max([padded[:, :, k : k + vertical] for k in range(3)], axis=0)


def _shifted(scores: Scores, down: int, across: int) -> Scores:
    """Return the scores of the patches that lie below and right by a number of grid steps; the border's go on."""
    rows, columns = scores.shape[:2]
    j = np.clip(np.arange(rows) + down, 0, rows - 1)
    i = np.clip(np.arange(columns) + across, 0, columns - 1)
    return scores[j][:, i]
