"""Coombs and Brown, "Real-time binocular smooth pursuit" (1993): PID pursuit of the centroid, vergence from disparity.

The integral remembers the target's speed, so that a steady ramp is followed without a steady error, and the gaze holds
while the rig itself turns. As with all feedback on delayed images, the gains are what the latency allows.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig
from vergence_servo.gaze.laws.protocol import LawView, target_residual
from vergence_servo.gaze.parameters import GazeParameters

Array = npt.NDArray[np.float64]

# version, vergence, tilt
_PROPORTIONAL = np.array([3.5, 3.5, 3.5])
_INTEGRAL = np.array([2.5, 1.0, 2.5])
_DERIVATIVE = np.array([0.1, 0.05, 0.1])
_LARGEST_INTEGRAL_RAD = 0.25
_INTEGRATED_RAD = math.radians(8.0)
_STALE_S = 0.3


class PidPursuitLaw:
    """Rates from errors; no saccades: large errors saturate the speed limit."""

    name = "pid_pursuit"
    unsigned = False

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the integral and the last error."""
        self._integral = self._errors = self._slope = np.zeros(3)
        self._stamp_s = -math.inf

    def wanted(self, view: LawView) -> Array:
        """Return the joint angles (3,) to command."""
        self._take(view)
        rates = _PROPORTIONAL * self._errors + _INTEGRAL * self._integral + _DERIVATIVE * self._slope
        version, vergence, tilt = rates * view.elapsed_s
        return view.turned(version, vergence, tilt)

    def residual(self, view: LawView) -> Array:
        """Return next to nothing: pursuit is smooth whatever the error, there is nothing to saccade for."""
        return np.clip(target_residual(view), -1e-3, 1e-3)

    def remaining_rad(self) -> float:
        """Return 0: the signed error says it."""
        return 0.0

    def _take(self, view: LawView) -> None:
        visual = view.visual
        if visual is None or view.now_s - visual.stamp_s > _STALE_S:
            self._errors = self._slope = np.zeros(3)
            return
        if visual.stamp_s <= self._stamp_s:
            return
        left, right, tilt = visual.error_rad
        pans = [error for error in (left, right) if math.isfinite(error)]
        version = float(np.mean(pans)) if pans else 0.0
        errors = np.nan_to_num(np.array([version, right - left if len(pans) == 2 else 0.0, tilt]))
        interval_s = visual.stamp_s - self._stamp_s
        if interval_s < _STALE_S:
            self._slope = (errors - self._errors) / interval_s
            # A jump is not a speed: large errors are left to the proportional part.
            integral = self._integral + np.where(np.abs(errors) < _INTEGRATED_RAD, errors, 0.0) * interval_s
            self._integral = np.clip(integral, -_LARGEST_INTEGRAL_RAD, _LARGEST_INTEGRAL_RAD)
        self._errors, self._stamp_s = errors, visual.stamp_s
