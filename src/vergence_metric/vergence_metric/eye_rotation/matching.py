"""Features matched between both eyes to a fraction of a pixel, along the rows of two epipolar views.

Corners are spread evenly over the left view, because vergence shows only in how rows differ between its four quarters.
Each is searched over all depths, by correlation at half resolution, and refined by Lucas and Kanade's method at full
resolution; refinement back to the left view has to return to the corner.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vergence_metric.eye_rotation.epipolar_view import EpipolarView

Array = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.uint8]

_CELLS = (10, 8)
_PATCH_PX = 7  # half a template, at half resolution
_NORMALISE_SIGMA_PX = 6.0
_NORMALISE_GAIN = 45.0
_NORMALISE_FLOOR = 4.0
_PEAK_RADIUS_PX = 3
_LK_WINDOW_PX = 17
_LK_ROUNDS = 30
_LK_MAX_SHIFT_PX = 3.0
_BACK_PX = 0.3
_MARGIN_PX = 12


@dataclass(frozen=True)
class MatchingSettings:
    """Number of features, search range, and the scores that a match needs."""

    features: int = 400
    quality: float = 0.01
    nearest_parallax_rad: float = 0.3
    aside_rad: float = 0.035
    rows_px: int = 14
    score: float = 0.8
    uniqueness: float = 0.96


@dataclass(frozen=True)
class Matches:
    """Matched points (N, 2) [px] of the left and the right view, and the number of corners detected."""

    left_px: Array
    right_px: Array
    corners: int


def matches(left: EpipolarView, right: EpipolarView, settings: MatchingSettings) -> Matches:
    """Return the features matched between both views."""
    views = [_normalised(view.grey) for view in (left, right)]
    corners = _corners(views[0], left.seen, settings)
    if not len(corners):
        return Matches(np.empty((0, 2)), np.empty((0, 2)), 0)
    found, start = _search(views, corners, (left, right), settings)
    corners_there, start = corners[found], start[found]
    kept, right_px = _refined(views[0], views[1], corners_there, start, right.seen)
    return Matches(corners_there[kept].astype(np.float64), right_px[kept].astype(np.float64), len(corners))


def _normalised(grey: Pixels) -> Pixels:
    """Return a view with local brightness and contrast normalised: the eyes' exposures differ."""
    image = grey.astype(np.float32)
    mean = cv2.GaussianBlur(image, (0, 0), _NORMALISE_SIGMA_PX)
    square = cv2.GaussianBlur(image * image, (0, 0), _NORMALISE_SIGMA_PX)
    spread = np.sqrt(np.maximum(square - mean * mean, 0.0)) + _NORMALISE_FLOOR
    return np.asarray(np.clip(128.0 + _NORMALISE_GAIN * (image - mean) / spread, 0, 255), np.uint8)


def _corners(view: Pixels, seen: npt.NDArray[np.bool_], settings: MatchingSettings) -> npt.NDArray[np.float32]:
    """Return corners (N, 2) [px], up to the same number from every cell of a grid."""
    strength = cv2.cornerMinEigenVal(view, 7)
    inside = cv2.erode(
        seen.astype(np.uint8), np.ones((2 * _MARGIN_PX + 1, 2 * _MARGIN_PX + 1), np.uint8), borderValue=0
    )
    peak = (strength == cv2.dilate(strength, np.ones((9, 9), np.uint8))) & (inside > 0)
    peak &= strength > settings.quality * float(strength.max(initial=0.0, where=inside > 0))
    y, x = np.nonzero(peak)
    if not len(x):
        return np.empty((0, 2), np.float32)
    height, width = view.shape
    cell = (y * _CELLS[1] // height) * _CELLS[0] + x * _CELLS[0] // width
    order = np.lexsort((-strength[y, x], cell))
    firsts = np.searchsorted(cell[order], cell[order], side="left")
    rank = np.arange(len(order)) - firsts
    best = order[rank < max(settings.features // (_CELLS[0] * _CELLS[1]), 1)]
    return np.column_stack([x[best], y[best]]).astype(np.float32)


def _search(
    views: list[Pixels],
    corners: npt.NDArray[np.float32],
    geometry: tuple[EpipolarView, EpipolarView],
    s: MatchingSettings,
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.float32]]:
    """Return which corners have one unambiguous match, and its position (N, 2) [px], to about a pixel."""
    left, right = (cv2.resize(view, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) for view in views)
    step = 2.0 * geometry[0].step_rad
    nearer, farther = round(s.nearest_parallax_rad / step), round(s.aside_rad / step)
    # A point at infinity has the same angle in both eyes; the views' centres have different ones.
    shift = (geometry[1].aside_rad - geometry[0].aside_rad) / step
    rows = max(s.rows_px // 2, 1)
    height, width = right.shape
    p = _PATCH_PX
    found = np.zeros(len(corners), np.bool_)
    places = np.zeros_like(corners)
    for i, (x_full, y_full) in enumerate(corners):
        x, y = round((float(x_full) - 0.5) / 2), round((float(y_full) - 0.5) / 2)
        x0, x1 = max(round(x + shift) - nearer - p, 0), min(round(x + shift) + farther + p + 1, width)
        y0, y1 = max(y - rows - p, 0), min(y + rows + p + 1, height)
        template = left[y - p : y + p + 1, x - p : x + p + 1] if min(x, y) >= p else left[:0]
        if template.shape != (2 * p + 1, 2 * p + 1) or x1 - x0 < 2 * p + 3 or y1 - y0 < 2 * p + 3:
            continue
        scores = cv2.matchTemplate(right[y0:y1, x0:x1], template, cv2.TM_CCOEFF_NORMED)
        _, best, _, (column, row) = cv2.minMaxLoc(scores)
        on_rim = not (0 < column < scores.shape[1] - 1 and 0 < row < scores.shape[0] - 1)
        if best < s.score or on_rim:
            continue
        scores[
            max(row - _PEAK_RADIUS_PX, 0) : row + _PEAK_RADIUS_PX + 1,
            max(column - _PEAK_RADIUS_PX, 0) : column + _PEAK_RADIUS_PX + 1,
        ] = -1
        if float(scores.max()) > s.uniqueness * best:
            continue
        found[i] = True
        places[i] = x_full + 2 * (x0 + column + p - x), y_full + 2 * (y0 + row + p - y)
    return found, places


def _refined(
    left: Pixels,
    right: Pixels,
    corners: npt.NDArray[np.float32],
    start: npt.NDArray[np.float32],
    seen: npt.NDArray[np.bool_],
) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.float32]]:
    """Return which matches are consistent from left to right and back, and their right positions (N, 2) [px]."""
    if not len(corners):
        return np.zeros(0, np.bool_), start
    there, ok_there = _flow(left, right, corners, start)
    back, ok_back = _flow(right, left, there, corners + 1.0)
    kept = ok_there & ok_back
    kept &= np.abs(there - start).max(axis=1) < _LK_MAX_SHIFT_PX
    kept &= np.abs(back - corners).max(axis=1) < _BACK_PX
    column = np.clip(np.rint(there[:, 0]).astype(int), 0, right.shape[1] - 1)
    row = np.clip(np.rint(there[:, 1]).astype(int), 0, right.shape[0] - 1)
    return kept & seen[row, column], there


def _flow(
    first: Pixels, second: Pixels, points: npt.NDArray[np.float32], guess: npt.NDArray[np.float32]
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.bool_]]:
    """Return positions (N, 2) in the second view of points of the first, near their guesses, and which converged."""
    moved, found, _ = cv2.calcOpticalFlowPyrLK(
        first,
        second,
        points.reshape(-1, 1, 2),
        guess.astype(np.float32).reshape(-1, 1, 2),
        winSize=(_LK_WINDOW_PX, _LK_WINDOW_PX),
        maxLevel=0,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, _LK_ROUNDS, 0.003),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(moved, np.float32).reshape(-1, 2), np.asarray(found).ravel() == 1
