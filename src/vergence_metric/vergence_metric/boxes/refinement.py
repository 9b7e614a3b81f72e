"""The disparity of the surface inside a pair of boxes: the mean over the pixels of it that both eyes see.

The box of a solid object has no single disparity. A coarse match of the whole box finds its disparity to a few pixels,
dense matching then measures every pixel's, and what lies behind the object is left out.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.crop import Crop
from vergence_metric.boxes.dense_matching import DenseView, match_densely
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.side_faces import side_values
from vergence_metric.boxes.uncertainty import surface_sigma_px

_COARSE_PX = 24  # width to which a box is shrunk for the first match
_CORE = 0.7  # of the box's sides: its corners may show what is behind
_SOUND_CORRELATION = 0.7
_LEAST_SIDE_PX = 8.0
_LEAST_DEPTH_PX, _DEPTH_SHARE = 1.5, 0.2  # of the box's width: faces of one object differ by no more
_LEAST_SHARE = 0.3


@dataclass(frozen=True)
class Refinement:
    """Mean disparity of the surface [px], its deviation [px], and confidence 0..1: the share of the boxes measured.

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
        return _nothing("the contents of the two boxes do not correlate")
    dense = match_densely(left, right, left_box, right_box, start)
    if dense is None:
        return _nothing("dense matching found nothing consistent in the boxes")
    depth_px = max(_LEAST_DEPTH_PX, _DEPTH_SHARE * width)
    # As the object's pixels in both images count, so do those of both views.
    near = tuple(_near(view, depth_px) for view in (dense.left, dense.right))
    values = np.concatenate(
        [view.disparity_px[kept] for view, kept in zip((dense.left, dense.right), near, strict=True)]
    )
    share = len(values) / max(int(dense.left.inside.sum() + dense.right.inside.sum()), 1)
    if share < _LEAST_SHARE:
        return _nothing("too small a share of the boxes could be matched")
    aside = side_values(dense, left_box, right_box, near)
    mean = (float(values.sum()) + sum(aside)) / (len(values) + len(aside))
    return Refinement(mean, dense.vertical_px, surface_sigma_px(left_box, share), share)


def _near(view: DenseView, depth_px: float) -> NDArray[np.bool_]:
    """Return where (h, w) a match is in the box and no further from the middle than its object can be."""
    if not view.found.any():
        return view.found
    middle = np.median(view.disparity_px[view.found])
    with np.errstate(invalid="ignore"):
        return np.asarray(view.found & (np.abs(view.disparity_px - middle) <= depth_px))


def _coarse(left: NDArray[Any], right: NDArray[Any], left_box: Box, right_box: Box) -> tuple[float, float] | None:
    """Match the core of the left box in the neighbourhood of the right one, shrunk: disparity to a pixel or so."""
    (width, height), (x, y) = left_box.size_px, left_box.center_px
    scale = max(1.0, width / _COARSE_PX)
    guess = x - right_box.center_px[0], y - right_box.center_px[1]
    core = _about((x, y), (_CORE * width, _CORE * height), scale)
    reach = 2.0 * (0.25 * width + 4.0)
    area = _about((x - guess[0], y - guess[1]), (_CORE * width + reach, _CORE * height + reach), scale)
    patch, field = core.of(left), area.of(right)
    if min(patch.shape) < 3 or patch.std() < 1.0:
        return None
    scores = cv2.matchTemplate(field, patch, cv2.TM_CCOEFF_NORMED)
    _, best, _, (column, row) = cv2.minMaxLoc(scores)
    if best < _SOUND_CORRELATION:
        return None
    return core.x0 - (area.x0 + column * scale), core.y0 - (area.y0 + row * scale)


def _about(center_px: tuple[float, float], size_px: tuple[float, float], scale: float) -> Crop:
    size = max(round(size_px[0] / scale), 1), max(round(size_px[1] / scale), 1)
    return Crop(center_px[0] - 0.5 * (size[0] - 1) * scale, center_px[1] - 0.5 * (size[1] - 1) * scale, scale, size)


def _nothing(reason: str) -> Refinement:
    return Refinement(math.nan, math.nan, math.nan, 0.0, reason)
