"""How the eyes moved while a pair was exposed: whether it is usable, and how precise a direction in it is."""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.parameters import GazeParameters

Array = npt.NDArray[np.float64]

_TIMING_SIGMA_S = 0.006
"""Stamps are off by milliseconds, and when a joint moved between two reports is not measured."""
_CATCHING_UP_RAD_S = 2.0
"""How fast the eyes may slip off a moving target: eyes that have to catch up get no still image."""
_REPORT_S = 0.02
_SIGMA_BOUNDS_RAD = (1e-5, 0.5)
_LARGEST_SKEW_S = 0.1


class Exposures:
    """Evaluates exposures by the joints' history."""

    def __init__(self, parameters: GazeParameters, history: ShaftHistory) -> None:
        self._p, self._history = parameters, history

    def were_still(self, stamp_s: float, skew_s: float, target: TargetEstimate | None) -> bool:
        """Return whether the eyes turned slowly enough, and for long enough before, for a pair to be used.

        In eyes that turn along with a target its image is as still as that of a target at rest in eyes at rest.
        """
        if not (math.isfinite(stamp_s) and math.isfinite(skew_s) and abs(skew_s) < _LARGEST_SKEW_S):
            return False
        if not self._history.covers(stamp_s):
            return False
        first, last = min(stamp_s, stamp_s + skew_s), max(stamp_s, stamp_s + skew_s)
        if self._history.speed_within(first - self._p.exposure.settle_s, last) < self._p.exposure.still_speed_rad_s:
            return True
        if target is None or not target.moving:
            return False
        return self._history.speed_within(first, last, target.joint_rates_rad_s) < _CATCHING_UP_RAD_S

    def sigma(self, stamp_s: float, skew_s: float, sigma_rad: float) -> float:
        """Return a direction's standard deviation including the stamps' timing error while the eyes move."""
        first, last = min(stamp_s, stamp_s + skew_s), max(stamp_s, stamp_s + skew_s)
        speed = self._history.speed_within(first - _REPORT_S, last + 0.001)
        return math.hypot(positive_sigma(sigma_rad, self._p.target.direction_sigma_rad), _TIMING_SIGMA_S * speed)


def positive_sigma(sigma_rad: float, fallback_rad: float) -> float:
    """Return a stated standard deviation within sensible bounds; `fallback_rad` if it is not a positive number."""
    if not (math.isfinite(sigma_rad) and sigma_rad > 0):
        return fallback_rad
    return min(max(sigma_rad, _SIGMA_BOUNDS_RAD[0]), _SIGMA_BOUNDS_RAD[1])
