"""The disparity of the surface inside a pair of boxes, by the sub-pixel estimators of metric I.

A solid thing's box has no one disparity. The mean over its visible surface does: a coarse match of the whole box finds
it to a few pixels, then the affine fit measures on a grid of places in the box, each where it lies in depth.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box
from vergence_metric.disparity.affine import fit_affine
from vergence_metric.disparity.correlation import radius_of
from vergence_metric.disparity.fovea_pair import Strip, cut

Array = NDArray[np.float64]

_COARSE_PX = 24  # width to which a box is shrunk for the first match
_CORE = 0.7  # of the box's sides: its corners may show what is behind
_GRID = 6
_LEAST_WINDOW_PX, _LARGEST_WINDOW_PX = 3.0, 9.0
_WINDOW_SHARE = 0.07  # of the box's smaller side
_LOCAL_PX, _LOCAL_SHARE = 3, 0.1  # of the box's width: how much nearer or farther a place may be than the whole
_BLUR_PX = 0.9
_SOUND_CORRELATION = 0.7
_LARGEST_SIGMA_PX = 0.8
_LEAST_SIDE_PX = 8.0
_VERTICAL_PX = 3.0


@dataclass(frozen=True)
class Refinement:
    """Mean disparity of the surface [px], its deviation [px], and confidence 0..1: the share of places that agree.

    NaN and 0 where nothing could be measured; `reason` then says why.
    """

    horizontal_px: float
    vertical_px: float
    sigma_px: float
    confidence: float
    reason: str = ""


def refine(left: NDArray[Any], right: NDArray[Any], left_box: Box, right_box: Box) -> Refinement:
    """Measure the surface's mean disparity inside a pair of boxes.

    Args:
        left: (h, w) grey uint8 of the left eye.
        right: (h, w) of the right one.
        left_box: the object in the left image.
        right_box: the same in the right image.

    """
    width, height = left_box.size_px
    if min(width, height, *right_box.size_px) < _LEAST_SIDE_PX:
        return _nothing(f"the box is smaller than {_LEAST_SIDE_PX:g} px")
    start = _coarse(left, right, left_box, right_box)
    if start is None:
        return _nothing("the boxes hold nothing alike")
    measured = _measure_grid(left, right, left_box, right_box, start)
    if len(measured) < 2:
        return _nothing("no place in the boxes could be matched")
    # Faces of one object differ in depth by no more than the object is wide; what is further off is behind it.
    middle = np.median(measured[:, :2], axis=0)
    near = np.abs(measured[:, 0] - middle[0]) <= max(1.5, 0.2 * width)
    near &= np.abs(measured[:, 1] - middle[1]) <= _VERTICAL_PX
    kept = measured[near]
    if len(kept) < 2:
        return _nothing("places in the boxes do not agree")
    horizontal, vertical = kept[:, 0].mean(), kept[:, 1].mean()
    sigma = math.hypot(float(kept[:, 2].mean()), float(kept[:, 0].std()) / math.sqrt(len(kept)))
    return Refinement(float(horizontal), float(vertical), sigma, len(kept) / _GRID**2)


def _coarse(left: NDArray[Any], right: NDArray[Any], left_box: Box, right_box: Box) -> tuple[float, float] | None:
    """Match the core of the left box in the neighbourhood of the right one, shrunk: disparity to a pixel or so."""
    scale = min(1.0, _COARSE_PX / left_box.size_px[0])
    core = _shrunk_box(left_box, _CORE)
    patch = _shrunk(left, core, 0.0, scale)
    guess = left_box.center_px[0] - right_box.center_px[0], left_box.center_px[1] - right_box.center_px[1]
    reach = 0.25 * left_box.size_px[0] + 4.0
    moved = core - np.array([guess[0], guess[1], guess[0], guess[1]])
    area = _shrunk(right, moved, reach, scale)
    if min(patch.shape) < 3 or area.shape[0] <= patch.shape[0] or area.shape[1] <= patch.shape[1] or patch.std() < 1.0:
        return None
    scores = cv2.matchTemplate(area, patch, cv2.TM_CCOEFF_NORMED)
    _, best, _, (x, y) = cv2.minMaxLoc(scores)
    if best < _SOUND_CORRELATION:
        return None
    extra = (area.shape[1] - patch.shape[1]) / 2, (area.shape[0] - patch.shape[0]) / 2
    return guess[0] - (x - extra[0]) / scale, guess[1] - (y - extra[1]) / scale


def _shrunk_box(box: Box, share: float) -> Array:
    (x, y), (width, height) = box.center_px, box.size_px
    half = np.array([width, height]) * 0.5 * share
    return np.array([x - half[0], y - half[1], x + half[0], y + half[1]])


def _shrunk(image: NDArray[Any], xyxy: Array, margin_px: float, scale: float) -> NDArray[np.float32]:
    """Return the part of an image that a box and a margin cover, at a scale, beyond the image its border repeated."""
    low, high = xyxy[:2] - margin_px, xyxy[2:] + margin_px
    size = np.maximum(np.rint((high - low) * scale), 1).astype(int)
    center = 0.5 * (low + high)
    # warpAffine with the inverse map: pixel i of the crop, counted about its middle, is 1/scale pixels of the image.
    matrix = np.array(
        [[1 / scale, 0, center[0] - (size[0] - 1) / 2 / scale], [0, 1 / scale, center[1] - (size[1] - 1) / 2 / scale]]
    )
    source = image
    if scale < 0.75:
        source = cv2.blur(image, (round(1 / scale), round(1 / scale)))
    crop = cv2.warpAffine(
        source,
        matrix,
        (int(size[0]), int(size[1])),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(crop, np.float32)


def _measure_grid(
    left: NDArray[Any], right: NDArray[Any], left_box: Box, right_box: Box, start: tuple[float, float]
) -> Array:
    """Return disparity, vertical disparity and deviation (K, 3) [px] at the places of a grid that could be fitted."""
    sigma = float(np.clip(_WINDOW_SHARE * min(left_box.size_px), _LEAST_WINDOW_PX, _LARGEST_WINDOW_PX))
    margin = radius_of(sigma) + 3
    most = _LOCAL_PX + round(_LOCAL_SHARE * left_box.size_px[0])
    reach = margin + 2 * most
    left_strip = _strip(left, left_box, margin)
    right_strip = _strip(right, right_box, reach)
    # The middles of equal parts of the box, so that their mean is the mean over it.
    x_min, y_min, x_max, y_max = _shrunk_box(left_box, 1.0 - 1.0 / _GRID)
    found = []
    for y in np.linspace(y_min, y_max, _GRID):
        for x in np.linspace(x_min, x_max, _GRID):
            local = _local(left_strip, right_strip, (float(x), float(y)), sigma, start, most)
            if local is None:
                continue
            warp = np.array([[1.0, 0.0, -local[0]], [0.0, 1.0, -local[1]]])
            fit = fit_affine(left_strip, right_strip, (float(x), float(y)), sigma, warp)
            if fit is None or fit.sigma_px > _LARGEST_SIGMA_PX or abs(fit.horizontal_px - local[0]) > 2.0:
                continue
            found.append((fit.horizontal_px, fit.vertical_px, fit.sigma_px))
    return np.array(found, np.float64).reshape(-1, 3)


def _strip(image: NDArray[Any], box: Box, margin: int) -> Strip:
    x0, y0 = math.floor(box.xyxy_px[0]) - margin, math.floor(box.xyxy_px[1]) - margin
    width, height = math.ceil(box.size_px[0]) + 2 * margin + 2, math.ceil(box.size_px[1]) + 2 * margin + 2
    crop = cut(image, x0, y0, width, height).astype(np.float32)
    return Strip(cv2.GaussianBlur(crop, (0, 0), _BLUR_PX), x0, y0)


def _local(
    left: Strip,
    right: Strip,
    point_px: tuple[float, float],
    sigma: float,
    start: tuple[float, float],
    reach: int,
) -> tuple[float, float] | None:
    """Return the whole-pixel disparity about the coarse one at which the window about a point fits best."""
    half = round(1.5 * sigma)
    x, y = round(point_px[0] - left.x0), round(point_px[1] - left.y0)
    patch = left.grey[y - half : y + half + 1, x - half : x + half + 1]
    u = round(point_px[0] - start[0] - right.x0)
    v = round(point_px[1] - start[1] - right.y0)
    rows = slice(v - half - 2, v + half + 3)
    columns = slice(u - half - reach, u + half + reach + 1)
    if rows.start < 0 or columns.start < 0 or rows.stop > right.grey.shape[0] or columns.stop > right.grey.shape[1]:
        return None
    if patch.shape != (2 * half + 1, 2 * half + 1) or patch.std() < 2.0:
        return None
    scores = cv2.matchTemplate(right.grey[rows, columns], patch, cv2.TM_CCOEFF_NORMED)
    _, best, _, (dx, dy) = cv2.minMaxLoc(scores)
    if best < _SOUND_CORRELATION:
        return None
    return (
        float(x + left.x0 - (u + dx - reach + right.x0)),
        float(y + left.y0 - (v + dy - 2 + right.y0)),
    )


def _nothing(reason: str) -> Refinement:
    return Refinement(math.nan, math.nan, math.nan, 0.0, reason)
