"""Waits for what moves, on behalf of a goal: the first region that moves in successive pairs is the target."""

import numpy as np

from vergence_metric.tracking.eye_view import Points
from vergence_metric.tracking.motion.moving_region import MotionDetector, MovingRegion
from vergence_metric.tracking.request import StoredPair, TrackRequest

_PAIRS = 3  # in which it has to move, one after another
_APART_RAD = 0.05  # the most by which it moves from one to the next, about 45 degrees a second


class AwaitedMotion:
    """What moves, in successive pairs, until it is sure.

    Args:
        goal_id: of the goal that asks for it.
    """

    def __init__(self, goal_id: int) -> None:
        self.goal_id, self._detector = goal_id, MotionDetector()
        self._count, self._angles = 0, np.full(2, np.nan)

    def update(self, pair: StoredPair) -> TrackRequest | str:
        """Return the request for the region that moves, as it is in a pair; else why there is none yet."""
        region = self._detector.update(pair.left, pair.views[0], pair.stamp_s)
        if isinstance(region, str):
            self._count = 0
            return region
        angles = self._angles_of(region, pair)
        # Comparisons with the NaN of no region before are false.
        self._count = self._count + 1 if float(np.abs(angles - self._angles).max()) <= _APART_RAD else 1
        self._angles = angles
        if self._count < _PAIRS:
            return f"something moves, in {self._count} of {_PAIRS} pairs"
        return TrackRequest(self.goal_id, pair.stamp_s, True, region.center_px, region.extent_px)

    def _angles_of(self, region: MovingRegion, pair: StoredPair) -> Points:
        return np.asarray(pair.views[0].angles(np.array([region.center_px]))[0])
