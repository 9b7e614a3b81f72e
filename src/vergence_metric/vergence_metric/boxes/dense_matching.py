"""Dense disparity inside a pair of boxes: flow for sub-pixel accuracy, semi-global matching where flow fails.

Dense inverse search (Kroeger et al., "Fast optical flow using dense inverse search", 2016) is smooth and needs no rows
that agree, but loses faces that one eye sees much narrower than the other. Semi-global matching (Hirschmueller, 2008)
follows those, on rows that the flow has brought together. Each is used where both directions agree.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.crop import Crop
from vergence_metric.boxes.detections import Box

Mask = NDArray[np.bool_]
Plane = NDArray[np.float32]

_WORKING_PX = 80.0  # width to which larger boxes are shrunk
_MARGIN_PX, _MARGIN_SHARE = 6.0, 0.2  # so that what leaves the box between the eyes is in view
_BEHIND_PX, _BEFORE_PX = 32, 16  # searched about the whole's disparity, at the working size; multiples of 16
_FLOW_AGREES_PX, _MATCH_AGREES_PX, _BOTH_AGREE_PX = 0.7, 1.0, 1.0
_LEAST_PIXELS = 30
_BLOCK_PX = 3
_SMOOTH, _STEP = 8, 64  # penalties of a change of disparity by one pixel and by more
_FAR = 1e3


@dataclass(frozen=True)
class DenseView:
    """One eye's box: `disparity_px` (h, w) in image pixels, `found` where it is valid, `inside` the box's pixels."""

    disparity_px: Plane
    found: Mask
    inside: Mask


@dataclass(frozen=True)
class DenseMatch:
    """Both eyes' views, the middle vertical disparity [px] and image pixels per pixel of the views."""

    left: DenseView
    right: DenseView
    vertical_px: float
    scale: float


def match_densely(
    left: NDArray[Any], right: NDArray[Any], left_box: Box, right_box: Box, start: tuple[float, float]
) -> DenseMatch | None:
    """Match the inside of a pair of boxes; None where nothing agrees.

    Args:
        left: (h, w) grey uint8 of the left eye.
        right: (h, w) of the right one.
        left_box: the object in the left image.
        right_box: the same in the right image.
        start: its disparity to a few pixels, horizontal and vertical [px].

    """
    (width, height), (x_min, y_min, _, _) = left_box.size_px, left_box.xyxy_px
    scale = max(1.0, width / _WORKING_PX)
    margin = _MARGIN_SHARE * width + _MARGIN_PX
    size = (int((width + 2 * margin) / scale) + 1, int((height + 2 * margin) / scale) + 1)
    here = Crop(x_min - margin, y_min - margin, scale, size)
    there = here.moved(start)
    pictures = here.of(left), there.of(right)
    insides = here.inside(left_box), there.inside(right_box)
    flows = _flow(*pictures), _flow(*pictures[::-1])
    agree = tuple(_disagreement(flows[i], flows[1 - i]) < _FLOW_AGREES_PX for i in (0, 1))
    consistent = insides[0] & agree[0]
    if int(consistent.sum()) < _LEAST_PIXELS:
        return None
    across = float(np.median(-flows[0][..., 0][consistent]))
    level = _levelled(pictures[1], flows[0], consistent, across)
    matched = _semi_global(pictures[0], level, across)
    views = []
    for eye, sign in ((0, -1.0), (1, 1.0)):
        smooth, steep = sign * flows[eye][..., 0], matched[eye]
        steep_found = _mismatch(steep, matched[1 - eye], sign) < _MATCH_AGREES_PX
        take_smooth = agree[eye] & (~steep_found | (np.abs(smooth - steep) < _BOTH_AGREE_PX))
        disparity = start[0] + scale * np.where(take_smooth, smooth, steep)
        found = (take_smooth | steep_found) & insides[eye]
        views.append(DenseView(np.asarray(disparity, np.float32), found, insides[eye]))
    vertical = start[1] - scale * float(np.median(flows[0][..., 1][consistent]))
    return DenseMatch(views[0], views[1], vertical, scale)


def _flow(source: NDArray[np.uint8], other: NDArray[np.uint8]) -> Plane:
    """Return where each pixel of one picture went in the other (h, w, 2)."""
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    search.setFinestScale(0)
    start = np.zeros((*source.shape, 2), np.float32)
    return np.asarray(search.calc(source, other, start), np.float32)


def _grid(shape: tuple[int, ...]) -> tuple[Plane, Plane]:
    y, x = np.mgrid[0 : shape[0], 0 : shape[1]].astype(np.float32)
    return x, y


def _disagreement(there: Plane, back: Plane) -> Plane:
    """Return how far from its start each pixel (h, w) arrives by going there and back."""
    x, y = _grid(there.shape)
    outside = (_FAR, _FAR, 0.0, 0.0)
    at = (x + there[..., 0], y + there[..., 1])
    returned = cv2.remap(back, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=outside)
    error = there + returned
    return np.asarray(np.hypot(error[..., 0], error[..., 1]), np.float32)


def _levelled(right: NDArray[np.uint8], flow: Plane, consistent: Mask, across: float) -> NDArray[np.uint8]:
    """Return the right picture with its rows where the left ones are, by a plane fitted to the vertical flow."""
    x, y = _grid(consistent.shape)
    design = np.column_stack([np.ones(int(consistent.sum())), x[consistent], y[consistent]]).astype(np.float64)
    vertical = flow[..., 1][consistent].astype(np.float64)
    for _ in range(3):
        plane = np.linalg.lstsq(design, vertical, rcond=None)[0]
        off = np.abs(design @ plane - vertical)
        near = off <= max(0.3, 2.0 * float(np.median(off)))
        design, vertical = design[near], vertical[near]
    rows = y + (plane[0] + plane[1] * (x + across) + plane[2] * y).astype(np.float32)
    return np.asarray(cv2.remap(right, x, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)


def _semi_global(left: NDArray[np.uint8], right: NDArray[np.uint8], across: float) -> tuple[Plane, Plane]:
    """Return both pictures' disparities (h, w), NaN where none was found."""
    first, count = math.floor(across) - _BEHIND_PX, _BEHIND_PX + _BEFORE_PX
    pad = count
    wide = [cv2.copyMakeBorder(p, 0, 0, pad, pad, cv2.BORDER_REPLICATE) for p in (left, right)]
    found = []
    for eye, lowest in ((0, first), (1, -(first + count - 1))):
        matcher = cv2.StereoSGBM.create(
            minDisparity=lowest, numDisparities=count, blockSize=_BLOCK_PX, P1=_SMOOTH, P2=_STEP, preFilterCap=31
        )
        shifts = matcher.compute(wide[eye], wide[1 - eye])[:, pad:-pad].astype(np.float32) / 16.0
        shifts[shifts < lowest] = np.nan
        found.append(shifts if eye == 0 else -shifts)
    return found[0], found[1]


def _mismatch(disparity: Plane, other: Plane, sign: float) -> Plane:
    """Return by how much each pixel's disparity (h, w) differs from that of the pixel it names in the other eye."""
    x, y = _grid(disparity.shape)
    known = np.nan_to_num(disparity, nan=0.0)
    far = np.nan_to_num(other, nan=_FAR)
    named = cv2.remap(
        far, x + np.float32(sign) * known, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=_FAR
    )
    return np.asarray(np.where(np.isnan(disparity), _FAR, np.abs(known - named)), np.float32)
