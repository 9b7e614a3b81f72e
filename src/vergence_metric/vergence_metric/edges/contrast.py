"""Contrast of the edge metric with chance: about 1 where two images are unrelated, well below 1 at vergence.

For edge pixels of direction bin k let d_k be the distance to the other image's nearest edge pixel of that bin, cut off
at a few pixels. With n_k edge pixels of bin k in the window,

    contrast = mean of d_k over the window's edge pixels / (sum of n_k * mean of d_k over all its pixels / sum of n_k).

The denominator is what the numerator would be at any unrelated alignment of the same two edge images, so that density,
texture and exposure cancel. It detects vergence but gives no direction: it is flat a few pixels away from vergence.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.oriented_edges import OrientedField
from vergence_metric.edges.windows import Window
from vergence_rig.verged import SMALL_WINDOWS_PX, best_small_window

_FOVEAL_SIGMAS = 4.0  # a window this many times as wide as the foveal weight's deviation holds it
_BORDER = np.ones((5, 5), np.uint8)  # edge pixels lie at the border of what they are edges of
_FEWEST_EDGE_PIXELS = 30
_LATTICE = 24  # points along a window's side that represent all its pixels


@dataclass(frozen=True)
class Contrasts:
    """Contrast in each window, (n,) float64, windows sorted by size; NaN where an image has no edge pixels."""

    left_to_right: NDArray[np.float64]
    right_to_left: NDArray[np.float64]

    @property
    def both(self) -> NDArray[np.float64]:
        """Mean of the two directions."""
        return (self.left_to_right + self.right_to_left) / 2.0


@dataclass(frozen=True)
class WindowContrast:
    """The contrast of one window, NaN where it could not be measured, and the window's requested side [px]."""

    contrast: float
    window_px: int


def small_windows(windows: Sequence[Window]) -> tuple[Window, ...]:
    """Return the windows that `least_contrast` needs, by size; the smallest one where none is small."""
    ordered = sorted(windows, key=lambda window: window.size_px)
    return tuple(w for w in ordered if w.size_px <= SMALL_WINDOWS_PX[1]) or (ordered[0],)


def least_contrast(field: OrientedField, truncation_px: int) -> WindowContrast:
    """Return the least contrast of the windows of SMALL_WINDOWS_PX; NaN where none is measurable."""
    found, sizes_px = contrasts(field, truncation_px).both.tolist(), [window.size_px for window in field.windows]
    best = best_small_window(sizes_px, found)
    return (
        WindowContrast(math.nan, SMALL_WINDOWS_PX[0]) if best is None else WindowContrast(found[best], sizes_px[best])
    )


def contrasts(field: OrientedField, truncation_px: int) -> Contrasts:
    """Return the contrast in every window of `field`, distances cut off at `truncation_px` (at most the field's).

    NaN in a window where either image has no edge pixel.
    """
    counts = [_counts(field, image) for image in (0, 1)]
    measurable = (counts[0].sum(axis=1) > 0) & (counts[1].sum(axis=1) > 0)
    ratios = []
    for direction in (0, 1):
        rings = field.images[direction].ring
        distance = field.distances_px(direction, truncation_px)
        total = np.bincount(rings, weights=distance, minlength=len(field.windows)).cumsum()
        everywhere = field.mean_distances_px(1 - direction, truncation_px, _LATTICE)
        chance = (counts[direction] * everywhere).sum(axis=1)
        # chance is 0 only where every pixel is an edge pixel: no contrast defined
        ratios.append(np.where(measurable & (chance > 0.0), total / np.where(chance > 0.0, chance, 1.0), np.nan))
    return Contrasts(*ratios)


def foveal_contrast(field: OrientedField, truncation_px: int, sigma_px: float) -> float:
    """Return the contrast at the fovea: edge pixels weigh less with their distance from the image centre.

    A window with a soft border: a target that fills only the middle of the smallest window still decides. The weight is
    a Gaussian; chance is that of the smallest window which holds two standard deviations of it. Mean of both
    directions, NaN where an image has no edge pixels.
    """
    wide_enough = [i for i, window in enumerate(field.windows) if window.size_px >= _FOVEAL_SIGMAS * sigma_px]
    window = wide_enough[0] if wide_enough else len(field.windows) - 1
    ratios = []
    for direction in (0, 1):
        edges, weight = field.images[direction], field.fovea_weights(direction, sigma_px)
        inside = edges.ring <= window
        of_bin = np.bincount(edges.bin[inside], weights=weight[inside], minlength=field.bins)
        everywhere = field.mean_distances_px(1 - direction, truncation_px, _LATTICE)[window]
        figure = float(weight[inside] @ field.distances_px(direction, truncation_px)[inside])
        chance = float(of_bin @ everywhere)
        ratios.append(figure / chance if chance > 0.0 else math.nan)
    return (ratios[0] + ratios[1]) / 2.0


def surface_contrast(
    field: OrientedField, truncation_px: int, support: NDArray[np.float32], corner: tuple[int, int]
) -> float:
    """Return the contrast of the edge pixels on or at the border of a surface; NaN where there are too few.

    A thing that fills little of every window has a contrast of its own, whatever is behind it.

    Args:
        field: the pair's edges.
        truncation_px: where distances are cut off, at most the field's.
        support: (h, w), 1 at the surface's pixels, else 0.
        corner: (column, row) of the support's top left pixel, from the corner of the field's largest window.

    """
    window = field.windows[-1]
    mask = np.zeros((window.height, window.width), np.float32)
    x, y = corner
    height, width = support.shape
    inside = slice(max(y, 0), max(y + height, 0)), slice(max(x, 0), max(x + width, 0))
    there = mask[inside]
    there[:] = support[max(-y, 0) :, max(-x, 0) :][: there.shape[0], : there.shape[1]]
    counts = np.asarray(cv2.dilate(mask, _BORDER)) > 0.0
    ratios = []
    for direction in (0, 1):
        edges = field.images[direction]
        on = counts[edges.places]
        if np.count_nonzero(on) < _FEWEST_EDGE_PIXELS:
            return math.nan
        everywhere = field.mean_distances_px(1 - direction, truncation_px, _LATTICE)[-1]
        chance = float(np.bincount(edges.bin[on], minlength=field.bins) @ everywhere)
        figure = float(field.distances_px(direction, truncation_px)[on].sum())
        ratios.append(figure / chance if chance > 0.0 else math.nan)
    return (ratios[0] + ratios[1]) / 2.0


def _counts(field: OrientedField, image: int) -> NDArray[np.int64]:
    """Return the number of edge pixels of each bin in each window, (windows, bins)."""
    edges, n = field.images[image], len(field.windows)
    cells = np.bincount(edges.ring * field.bins + edges.bin, minlength=n * field.bins)
    return cells.reshape(n, field.bins).cumsum(axis=0)
