"""Vertical offset and roll between two eyes, estimated from one pair of images of any depths.

Small patches with structure in both directions are matched in the other image, at any horizontal position. Their
vertical disparity is, in pixels from the image centre,

    y_left - y_right = vertical - roll * x_right + c * y + k * x_right * y,

where c (one eye is nearer to the scene) and k (converged eyes see keystones) belong to the gaze, not to the mounts, and
are estimated only to separate them from the other two. Wrong matches are rejected by random sampling (MSAC).
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Grey = NDArray[np.uint8]

_COARSE = 4  # patches are first matched at a quarter of the size
_COARSE_PATCH_PX = 10  # half sides
_FINE_PATCH_PX = 10
_FINE_SEARCH_PX = 5
_PATCHES = 72
_MIN_SIMILARITY = 0.7
_UNIQUENESS = 0.9
_INLIER_PX = 1.5
_MIN_INLIERS = 8
_MIN_INLIER_SHARE = 0.4
_MAX_SCALE, _MAX_KEYSTONE = 0.15, 0.15  # of c, and of k times half the image's width
_SAMPLES = 300
_NOISE_PX = 0.5
# standard deviations of the prior: offset [px], and of roll, c and k their effect at half the image's width, as a
# share of it
_PRIOR_OFFSET_PX, _PRIOR_SHARES = 100.0, (0.02, 0.04, 0.04)


@dataclass(frozen=True)
class Misalignment:
    """Vertical offset and roll of the right image against the left one.

    `vertical_px` is y_left - y_right at the centre of the right image, `roll_rad` its rotation, clockwise positive;
    `..._sigma` are their standard deviations. Of `matches` matched patches `inliers` agree.
    """

    vertical_px: float
    roll_rad: float
    vertical_sigma_px: float
    roll_sigma_rad: float
    matches: int
    inliers: int


def estimate_misalignment(
    left: Grey, right: Grey, *, search_horizontal_px: int, search_vertical_px: int, about_vertical_px: float = 0.0
) -> Misalignment | None:
    """Return the misalignment of two (h, w) uint8 images, None where too few patches match.

    Patches are searched to `search_horizontal_px` on both sides and to `search_vertical_px` up and down of where the
    offset `about_vertical_px` has them.
    """
    found = _matches(left, right, (search_horizontal_px, search_vertical_px), about_vertical_px)
    half_width = left.shape[1] / 2.0
    x = (found[:, 0] - (left.shape[1] - 1) / 2.0) / half_width
    y = (found[:, 1] - (left.shape[0] - 1) / 2.0) / half_width
    design, offset = np.column_stack([np.ones_like(x), x, y, x * y]), found[:, 2]
    needed = max(_MIN_INLIERS, _MIN_INLIER_SHARE * len(offset))
    if len(offset) < needed:
        return None
    inlier = _consensus(design, offset, half_width)
    prior = np.diag(_NOISE_PX / np.array([_PRIOR_OFFSET_PX, *(share * half_width for share in _PRIOR_SHARES)]))
    for _ in range(4):
        if inlier.sum() < needed:
            return None
        agreed, solution = inlier, _solve(design[inlier], offset[inlier], prior)
        inlier = np.abs(design @ solution - offset) < _INLIER_PX
    residual = design[agreed] @ solution - offset[agreed]
    variance = max(float(residual @ residual) / (len(residual) - design.shape[1]), _NOISE_PX**2)
    covariance = variance * np.linalg.inv(design[agreed].T @ design[agreed] + prior.T @ prior)
    return Misalignment(
        vertical_px=float(solution[0]),
        roll_rad=-math.atan(solution[1] / half_width),
        vertical_sigma_px=math.sqrt(covariance[0, 0]),
        roll_sigma_rad=math.sqrt(covariance[1, 1]) / half_width,
        matches=len(offset),
        inliers=int(agreed.sum()),
    )


def _solve(design: NDArray[np.float64], offset: NDArray[np.float64], prior: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the least-squares model, regularised by `prior` where the matches do not determine it."""
    solution, *_ = np.linalg.lstsq(np.vstack([design, prior]), np.append(offset, np.zeros(len(prior))), rcond=None)
    return solution


def _consensus(design: NDArray[np.float64], offset: NDArray[np.float64], half_width: float) -> NDArray[np.bool_]:
    """Return which matches agree with the best of many models drawn through four of them each."""
    draws = np.random.default_rng(0).permuted(np.tile(np.arange(len(offset)), (_SAMPLES, 1)), axis=1)[:, :4]
    systems = design[draws]
    regular = np.abs(np.linalg.det(systems)) > 1e-4
    models = np.linalg.solve(systems[regular], offset[draws[regular]][..., None])[..., 0]
    possible = (np.abs(models[:, 2]) < _MAX_SCALE * half_width) & (np.abs(models[:, 3]) < _MAX_KEYSTONE * half_width)
    # the simplest models are candidates too: the vertical offset of each match alone
    flat = np.column_stack([offset, np.zeros((len(offset), 3))])
    models = np.concatenate([models[possible], flat])
    squared = (models @ design.T - offset) ** 2
    cost = np.minimum(squared, _INLIER_PX**2).sum(axis=1)
    return squared[int(cost.argmin())] < _INLIER_PX**2


def _matches(left: Grey, right: Grey, reach_px: tuple[int, int], about_vertical_px: float) -> NDArray[np.float64]:
    """Return x_right, y_right and y_left - y_right [px] of each matched patch, (n, 3)."""
    size = (left.shape[1] // _COARSE, left.shape[0] // _COARSE)
    if min(size) < 4 * _COARSE_PATCH_PX:
        return np.empty((0, 3))
    small_left = cv2.resize(left, size, interpolation=cv2.INTER_AREA)
    small_right = cv2.resize(right, size, interpolation=cv2.INTER_AREA)
    corners = cv2.goodFeaturesToTrack(small_left, _PATCHES, 0.01, max(6.0, size[0] / 20.0), blockSize=5)
    expected, reach = (0, -round(about_vertical_px / _COARSE)), (-(-reach_px[0] // _COARSE), -(-reach_px[1] // _COARSE))
    found = []
    for x, y in np.empty((0, 2)) if corners is None else corners.reshape(-1, 2):
        coarse = _find(small_left, small_right, round(x), round(y), _COARSE_PATCH_PX, expected, reach)
        if coarse is None:
            continue
        at = (round(x) * _COARSE + _COARSE // 2, round(y) * _COARSE + _COARSE // 2)
        guess = (round(coarse[0] * _COARSE), round(coarse[1] * _COARSE))
        fine = _find(left, right, *at, _FINE_PATCH_PX, guess, (_FINE_SEARCH_PX, _FINE_SEARCH_PX))
        if fine is not None:
            found.append((at[0] + fine[0], at[1] + fine[1], -fine[1]))
    return np.array(found).reshape(-1, 3)


def _find(
    left: Grey, right: Grey, x: int, y: int, half: int, guess: tuple[int, int], reach: tuple[int, int]
) -> tuple[float, float] | None:
    """Return the displacement (x, y) in `right` of the patch of `left` about (x, y), None without a clear match."""
    height, width = left.shape
    if not (half <= x < width - half and half <= y < height - half):
        return None
    x_low, x_high = max(x + guess[0] - reach[0], half), min(x + guess[0] + reach[0], width - half - 1)
    y_low, y_high = max(y + guess[1] - reach[1], half), min(y + guess[1] + reach[1], height - half - 1)
    if x_high - x_low < 2 or y_high - y_low < 2:
        return None
    patch = left[y - half : y + half + 1, x - half : x + half + 1]
    area = right[y_low - half : y_high + half + 1, x_low - half : x_high + half + 1]
    similarity = cv2.matchTemplate(area, patch, cv2.TM_CCOEFF_NORMED)
    _, best, _, (column, row) = cv2.minMaxLoc(similarity)
    if best < _MIN_SIMILARITY or not (0 < column < similarity.shape[1] - 1 and 0 < row < similarity.shape[0] - 1):
        return None
    if _is_ambiguous(similarity, row, half):
        return None
    across, down = similarity[row, column - 1 : column + 2], similarity[row - 1 : row + 2, column]
    return x_low + column + _vertex(across) - x, y_low + row + _vertex(down) - y


def _is_ambiguous(similarity: NDArray[np.float32], row: int, half: int) -> bool:
    """Return whether the patch matches about as well in other rows, where it cannot be the same."""
    other_rows = max(
        similarity[: max(row - half // 2, 0)].max(initial=-1.0), similarity[row + half // 2 + 1 :].max(initial=-1.0)
    )
    return bool(other_rows > _UNIQUENESS * similarity[row].max())


def _vertex(three: NDArray[np.float32]) -> float:
    """Return where the parabola through values at -1, 0 and 1, the middle one the largest, has its top."""
    curvature = float(three[0] - 2.0 * three[1] + three[2])
    return 0.0 if curvature >= 0.0 else 0.5 * float(three[0] - three[2]) / curvature
