"""Saccades and rest of the eyes, from their joint angles."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from vergence_metric.tracking.parameters import TrackerParameters
from vergence_rig.geometry import EyeAngles

StampedEyeAngles = tuple[float, EyeAngles]
"""Joint angles with their stamp [s]."""


@dataclass(frozen=True)
class EyeMotion:
    """Motion of the eyes at a frame.

    `saccading`: a saccade is in progress. `jumped`: there was one since the frame before. `rested_s`: time for which
    the joints have been at rest, 0 while they move.
    """

    saccading: bool
    jumped: bool
    rested_s: float


class SaccadeDetector:
    """Detects saccades and rest from the joint angles of successive frames, and from samples between them.

    A jump of either eye counts: one of the right eye alone is a jump in depth, to something else on the same ray.
    """

    def __init__(self, parameters: TrackerParameters) -> None:
        self._parameters = parameters
        self._history: deque[StampedEyeAngles] = deque()
        self._frame: StampedEyeAngles | None = None
        self._rest_since_s = math.nan

    def update(self, stamp_s: float, eyes: EyeAngles, samples: Iterable[StampedEyeAngles] = ()) -> EyeMotion:
        """Return the motion of the eyes at a frame; stamps must increase.

        `samples` are joint angles since the frame before, and those that follow this one as far as they are known.
        Without the former a saccade between two frames that are far apart can be missed. Of the latter a jump says that
        the eyes may have been anywhere between: angles at the frame lie on a straight line between two samples.
        """
        jumped = False
        later: list[StampedEyeAngles] = []
        for sample_s, angles in samples:
            if sample_s >= stamp_s:
                later.append((sample_s, angles))
            elif self._history and self._history[-1][0] < sample_s:
                jumped |= self._turns_fast(sample_s, angles)
                self._history.append((sample_s, angles))
        saccading = self._turns_fast(stamp_s, eyes)
        self._history.append((stamp_s, eyes))
        saccading |= any(self._turns_fast(sample_s, angles) for sample_s, angles in later)
        if self._frame is None:
            self._rest_since_s = stamp_s
        else:
            before_s, before = self._frame
            if _rotation_rad(before, eyes) > self._parameters.rest_rad_s * (stamp_s - before_s):
                self._rest_since_s = math.nan
            elif math.isnan(self._rest_since_s):
                self._rest_since_s = before_s
        self._frame = stamp_s, eyes
        rested = 0.0 if math.isnan(self._rest_since_s) else stamp_s - self._rest_since_s
        return EyeMotion(saccading, saccading or jumped, rested)

    def _turns_fast(self, stamp_s: float, eyes: EyeAngles) -> bool:
        """Return whether the eyes have turned fast until a stamp that is later than the history."""
        p = self._parameters
        # The newest sample stays, however old. A margin of 1 ms: frames 33 ms apart are compared over all of 67 ms.
        while len(self._history) > 1 and self._history[0][0] < stamp_s - p.saccade_s - 1e-3:
            self._history.popleft()
        # Before a late frame the speed of the eyes is unknown: up to twice saccade_s the threshold stays the same.
        return any(
            _rotation_rad(before, eyes) > p.saccade_rad * max(0.5 * (stamp_s - s) / p.saccade_s, 1.0)
            for s, before in self._history
        )


def _rotation_rad(before: EyeAngles, now: EyeAngles) -> float:
    """Return the largest rotation of a joint between two poses."""
    return max(
        abs(now.pan_left_rad - before.pan_left_rad),
        abs(now.pan_right_rad - before.pan_right_rad),
        abs(now.tilt_rad - before.tilt_rad),
    )
