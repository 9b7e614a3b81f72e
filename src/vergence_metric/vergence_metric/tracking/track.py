"""Where the followed target is, as TargetTrack.msg tells it."""

import math
from dataclasses import dataclass
from enum import IntEnum

from vergence_metric.tracking.saccade_detector import Pixel

NOWHERE: Pixel = (math.nan, math.nan)


class TrackStatus(IntEnum):
    """The numbers are those of TargetTrack.msg."""

    OK = 0
    LOCKING = 1
    LOST = 2
    OCCLUDED = 3
    UNLOCKED = 4


@dataclass(frozen=True)
class Track:
    """Where the target is; the fields are those of TargetTrack.msg, NaN where unknown.

    `left_px`, `right_px` (x, y) in the images given, `disparity_px` = x_left - x_right, `extent_px` (width, height) of
    the region locked on at its present scale. `confidence` is the likeness of the target to itself, lowered where its
    disparity could not be confirmed.
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

    @classmethod
    def nowhere(cls, track_id: int, status: TrackStatus, reason: str, lock_stamp_s: float = math.nan) -> "Track":
        """Return that the target is not seen, and why."""
        nan = math.nan
        return cls(track_id, lock_stamp_s, NOWHERE, NOWHERE, nan, nan, nan, NOWHERE, 0.0, status, reason)
