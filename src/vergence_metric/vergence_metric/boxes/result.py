"""The result of metric II for one pair of images."""

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from vergence_metric.boxes.corner_metric import CornerMetric
from vergence_metric.boxes.detections import Box, Detections
from vergence_metric.boxes.refinement import Refinement
from vergence_metric.boxes.seen_object import SeenObject
from vergence_metric.boxes.target_point import TargetPoint

NAN2 = (math.nan, math.nan)
UNREFINED = Refinement(math.nan, math.nan, math.nan, 0.0)


class BoxStatus(IntEnum):
    """Whether the pair could be measured, or why not; the numbers are those of BoxVergence.msg."""

    OK = 0
    NO_TARGET = 1
    LEFT_ONLY = 2
    RIGHT_ONLY = 3
    AMBIGUOUS = 4
    CUT = 5
    OCCLUDED = 6


def no_metric() -> CornerMetric:
    """Return the metric of no pair: all NaN."""
    return CornerMetric(np.full(4, math.nan), np.full(2, math.nan), math.nan, (False, False, False, False))


@dataclass(frozen=True)
class BoxVergenceResult:
    """Metric II of one pair of images; figures that could not be computed are NaN, and `status` says why.

    `left` and `right` are the target's boxes, as smoothed, None where an eye does not see it. `metric` has the corner
    differences in raw pixels. `center_px`, `refined` are disparities of the boxes' centres and of the surface (mean
    over what both eyes see), (horizontal, vertical), without lens distortion if camera models are given; `center_rad`
    is the centres' in angle. `sigma_px` is the standard deviation of the horizontal `center_px`. `left_rad` and
    `right_rad` are the directions of the target's point (`Box.point_px`) in each eye, azimuth (right positive) and
    elevation (down positive). `point` is where it is in rig_base, None if unknown. `objects` are all that are in view,
    `target` is the chosen one of them, None without one, and `choice_reason` says why.
    """

    status: BoxStatus
    reason: str
    left_detections: Detections
    right_detections: Detections
    left: Box | None = None
    right: Box | None = None
    metric: CornerMetric | None = None
    center_px: tuple[float, float] = NAN2
    center_rad: tuple[float, float] = NAN2
    sigma_px: float = math.nan
    refined: Refinement = UNREFINED
    left_rad: tuple[float, float] = NAN2
    right_rad: tuple[float, float] = NAN2
    point: TargetPoint | None = None
    target: SeenObject | None = None
    choice_reason: str = ""
    objects: tuple[SeenObject, ...] = ()

    @property
    def object_id(self) -> int:
        """The target's id, 0 without a target."""
        return self.target.object_id if self.target else 0

    @property
    def class_name(self) -> str:
        """The target's class, empty without a target."""
        box = self.left or self.right
        return box.class_name if box else ""

    @property
    def corners(self) -> CornerMetric:
        """The corner differences, all NaN where there is no pair."""
        return self.metric or no_metric()
