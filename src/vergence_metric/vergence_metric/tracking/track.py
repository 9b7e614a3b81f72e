"""The state of the followed target in one pair; the fields of TargetTrack.msg."""

import math
from dataclasses import dataclass, field
from enum import IntEnum

from vergence_metric.disparity.protocol import Surface
from vergence_metric.tracking.eye_view import Pixel

NOWHERE: Pixel = (math.nan, math.nan)


class TrackStatus(IntEnum):
    """State of the track; the values are those of TargetTrack.msg."""

    OK = 0
    LOCKING = 1
    LOST = 2
    OCCLUDED = 3
    UNLOCKED = 4
    AMBIGUOUS = 5
    UNUSABLE_IMAGES = 6


@dataclass(frozen=True)
class Track:
    """Position of the target in one pair; the fields are those of TargetTrack.msg, NaN where unknown.

    `left_px`, `right_px` (x, y) in the images given, `disparity_px` = x_left - x_right, `extent_px` (width, height) of
    the locked region at its present scale. `confidence` is the similarity to the target's appearance, lowered where the
    disparity could not be measured. `goal_id` is that of the request which the track answers, 0 for none.
    `candidates` are the disparities [px] that a requested target may have, likeliest first, each with its weight.
    `surface` is what the point lies on, where it was measured.
    """

    track_id: int
    lock_stamp_s: float
    left_px: Pixel
    right_px: Pixel
    disparity_px: float
    vertical_px: float
    sigma_px: float
    extent_px: tuple[float, float]
    confidence: float
    status: TrackStatus
    reason: str
    goal_id: int = 0
    candidates: tuple[tuple[float, float], ...] = ()
    surface: Surface | None = field(default=None, repr=False, compare=False)

    @classmethod
    def nowhere(cls, track_id: int, status: TrackStatus, reason: str, lock_stamp_s: float = math.nan) -> "Track":
        """Return the track of a target that is not visible, with the reason."""
        nan = math.nan
        return cls(track_id, lock_stamp_s, NOWHERE, NOWHERE, nan, nan, nan, NOWHERE, 0.0, status, reason)
