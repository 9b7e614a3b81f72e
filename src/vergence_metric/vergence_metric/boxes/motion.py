"""What moves before eyes at rest: regions of one eye's images that differ from the mean of the last ones.

Each image of both eyes is searched, at a detector's rate and with gaps of up to a second: `tracking/motion/` costs
forty times as much and needs images in quick succession, but it works while the eyes turn, and gives a mask.
"""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box, covered_share, cut_sides
from vergence_metric.boxes.follow_parameters import MotionParameters
from vergence_metric.edges.edges import to_grey

MOTION_CLASS = "motion"
MOTION_CLASS_ID = -2
"""Of no class of a detector: those are counted from 0."""

_SHRINK = 8
_MEAN_S = 0.5  # time constant of the mean image
_FORGET_S = 1.0  # a gap after which images are not compared
_STILL_RAD = 0.0005  # eyes that turned by more since the last image show motion everywhere
_NOISE_FACTOR = 5.0  # a change of so many times the typical one is no noise
_LARGEST_SHARE = 0.4  # beyond, the light has changed and not an object
_MOST_REGIONS = 3
_INSIDE_SHARE = 0.5  # of a moving region that lies in a detected box: the box is the better description


class ChangeDetector:
    """Compares one eye's images in order of their stamps."""

    def __init__(self, parameters: MotionParameters) -> None:
        self.parameters = parameters
        self._mean: NDArray[np.float32] | None = None
        self._stamp_s = math.nan
        self._pose = (math.nan, math.nan)

    def detect(self, image: NDArray[Any], stamp_s: float, pose_rad: tuple[float, float] | None) -> list[Box]:
        """Return the boxes of what moves, the largest first; none in the first image after the eye turned.

        Args:
            image: (h, w, 3) BGR or (h, w) grey uint8.
            stamp_s: of the image.
            pose_rad: pan and tilt of the eye at the stamp; None where they are not known and the eye does not turn.

        """
        height, width = image.shape[:2]
        small_size = max(width // _SHRINK, 1), max(height // _SHRINK, 1)
        small = cv2.resize(to_grey(image), small_size, interpolation=cv2.INTER_AREA).astype(np.float32)
        passed_s, before = stamp_s - self._stamp_s, self._mean
        turned = pose_rad is not None and not math.dist(pose_rad, self._pose) <= _STILL_RAD
        self._stamp_s, self._pose = stamp_s, pose_rad or (math.nan, math.nan)
        if before is None or turned or before.shape != small.shape or not 0.0 < passed_s <= _FORGET_S:
            self._mean = small
            return []
        share = passed_s / (passed_s + _MEAN_S)
        self._mean = np.asarray(before + share * (small - before), np.float32)
        change = small - before
        # The same everywhere: exposure or light.
        change = np.abs(change - np.median(change))
        least = max(self.parameters.min_change, _NOISE_FACTOR * float(np.median(change)))
        moving = (change > least).astype(np.uint8)
        if moving.mean() > _LARGEST_SHARE:
            self._mean = small
            return []
        return self._regions(moving, (width / small_size[0], height / small_size[1]), (width, height))

    def _regions(
        self, moving: NDArray[np.uint8], scale: tuple[float, float], image_size_px: tuple[int, int]
    ) -> list[Box]:
        # What moves shows at its edges: what is between them belongs to it.
        joined = cv2.morphologyEx(moving, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
        _, _, statistics, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
        regions = statistics[1:]
        regions = regions[regions[:, cv2.CC_STAT_AREA] >= self.parameters.min_share * moving.size]
        regions = regions[np.argsort(-regions[:, cv2.CC_STAT_AREA], kind="stable")][:_MOST_REGIONS]
        if not len(regions):
            return []
        corners = np.column_stack([regions[:, :2], regions[:, :2] + regions[:, 2:4]]).astype(np.float64)
        xyxy_px = corners * np.tile(scale, 2) - 0.5
        filled = regions[:, cv2.CC_STAT_AREA] / (regions[:, 2] * regions[:, 3])
        return [
            Box((x_min, y_min, x_max, y_max), float(score), MOTION_CLASS_ID, MOTION_CLASS, (left, top, right, bottom))
            for (x_min, y_min, x_max, y_max), score, (left, top, right, bottom) in zip(
                xyxy_px.tolist(), filled, cut_sides(xyxy_px, image_size_px).tolist(), strict=True
            )
        ]


def outside_of(moving: list[Box], detected: list[Box]) -> list[Box]:
    """Return the moving regions that do not lie mostly in a detected box."""
    return [one for one in moving if not any(covered_share(one, box) > _INSIDE_SHARE for box in detected)]
