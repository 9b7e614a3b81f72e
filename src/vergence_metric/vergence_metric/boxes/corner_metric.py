"""Metric II of one pair of boxes: the differences of their corners, both ways, and what follows from them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box

Array = NDArray[np.float64]
LEFT, TOP, RIGHT, BOTTOM = range(4)


@dataclass(frozen=True)
class CornerMetric:
    """Corner differences of a pair of boxes [px]; NaN where a side is cut by the border or hidden.

    `left_minus_right_px` is (top-left x, top-left y, bottom-right x, bottom-right y); `right_minus_left_px` is its
    negative, as the paper has both. `center_px` is the disparity of the centres, horizontal and vertical. `size_ratio`
    is the right box's width over the left one's. `valid_sides` is True for
    those of (left, top, right, bottom) that are sides of the object in both eyes.
    """

    left_minus_right_px: Array
    center_px: Array
    size_ratio: float
    valid_sides: tuple[bool, bool, bool, bool]

    @property
    def right_minus_left_px(self) -> Array:
        """The differences the other way."""
        return -self.left_minus_right_px


def corner_metric(left: Box, right: Box, hidden: tuple[bool, bool, bool, bool] = (False,) * 4) -> CornerMetric:
    """Measure a pair; `hidden` is True for the sides (left, top, right, bottom) that are occluded in one eye."""
    valid_sides = [not (a or b or c) for a, b, c in zip(left.cut, right.cut, hidden, strict=True)]
    difference = np.subtract(left.xyxy_px, right.xyxy_px, dtype=np.float64)
    difference[[not good for good in valid_sides]] = math.nan
    # A centre needs both its sides: NaN passes through the mean.
    center = np.array([difference[[LEFT, RIGHT]].mean(), difference[[TOP, BOTTOM]].mean()])
    whole = valid_sides[LEFT] and valid_sides[RIGHT]
    ratio = right.size_px[0] / left.size_px[0] if whole and left.size_px[0] > 0 else math.nan
    return CornerMetric(difference, center, ratio, (valid_sides[0], valid_sides[1], valid_sides[2], valid_sides[3]))


def hidden_sides(
    left: Box, right: Box, largest_ratio: float, disparity_px: float, vertical_px: float
) -> tuple[bool, bool, bool, bool]:
    """Return which sides are occluded in one eye only: where the boxes' sizes disagree.

    The side whose disparity is further from the object's is the occluded one; where the object's is unknown, both
    count as occluded.

    Args:
        left: the left eye's box.
        right: the right eye's.
        largest_ratio: of widths or heights that still are one object's.
        disparity_px: of the object's surface, NaN if unknown.
        vertical_px: y_left - y_right of the mounts.

    """
    hidden = [False] * 4
    for near, far, expected in ((LEFT, RIGHT, disparity_px), (TOP, BOTTOM, vertical_px)):
        if left.cut[near] or left.cut[far] or right.cut[near] or right.cut[far]:
            continue
        sizes = left.xyxy_px[far] - left.xyxy_px[near], right.xyxy_px[far] - right.xyxy_px[near]
        if max(sizes) <= largest_ratio * max(min(sizes), 1e-6):
            continue
        if math.isnan(expected):
            hidden[near] = hidden[far] = True
            continue
        off = [abs(left.xyxy_px[side] - right.xyxy_px[side] - expected) for side in (near, far)]
        hidden[near if off[0] > off[1] else far] = True
    return hidden[0], hidden[1], hidden[2], hidden[3]
