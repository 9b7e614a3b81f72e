"""Olson and Coombs, "Real-time vergence control for binocular robots" (1991): PD vergence, bang-bang saccades.

Gaze and vergence angle are controlled apart: disparity drives the vergence through a PD rule, the target's place in the
image drives gaze through saccades at full speed and, between them, through a PD rule of its own. The error is the last
image's; nothing is predicted, so the gains have to be small enough for the latency.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_gaze.laws.protocol import ControlInput, target_residual
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase
from vergence_rig.parameters import Parameters, parameter
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PdBangbangParameters(Parameters):
    """Gains: rate = kp * (error + derivative_time * slope of the error)."""

    gaze_kp: float = parameter(
        4.0, "proportional gain of version and tilt: joint rate over error", unit="1/s", minimum=0, maximum=100
    )
    gaze_derivative_time_s: float = parameter(
        0.05, "derivative time of version and tilt", unit="s", minimum=0, maximum=10
    )
    vergence_kp: float = parameter(
        4.0, "proportional gain of vergence: vergence rate over error", unit="1/s", minimum=0, maximum=100
    )
    vergence_derivative_time_s: float = parameter(0.05, "derivative time of vergence", unit="s", minimum=0, maximum=10)
    stale_after_s: float = parameter(
        0.3, "age of a visual error from which the eyes hold still instead", unit="s", minimum=0.01, maximum=10
    )


class PdBangbangLaw:
    """Rates from errors, saccades to where the target was seen."""

    name = "pd_bangbang"
    Parameters = PdBangbangParameters
    unsigned = False
    lands_at_rest = True

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._p = p = parameters.of_law(PdBangbangParameters)
        self._kp = np.array([p.gaze_kp, p.vergence_kp, p.gaze_kp])
        self._derivative_time_s = np.array(
            [p.gaze_derivative_time_s, p.vergence_derivative_time_s, p.gaze_derivative_time_s]
        )
        self.reset()

    def reset(self) -> None:
        """Forget the last error and any saccade under way."""
        self._stamp_s = -math.inf
        self._before = self._slope = np.zeros(3)
        self._landing: Array | None = None
        self._landed_s = -math.inf

    def compute_command(self, state: ControlInput) -> Array:
        """Return the joint angles (3,) to command."""
        if state.phase is Phase.SACCADE:
            if self._landing is None:
                self._landing = state.target.at(state.target.time_s).joints_rad
            return np.where(state.driven, state.joint_goal(self._landing), np.nan)
        if self._landing is not None:
            self._landing, self._landed_s = None, state.now_s
        errors = self._errors(state)
        version, vergence, tilt = (self._kp * (errors + self._derivative_time_s * self._slope)) * state.elapsed_s
        return state.turned(version, vergence, tilt)

    def residual(self, state: ControlInput) -> Array:
        """Return how far each driven joint (3,) is from the target now."""
        return target_residual(state)

    def remaining_rad(self) -> float:
        """Return 0: this law relies on the signed error."""
        return 0.0

    def _errors(self, state: ControlInput) -> Array:
        """Return version, vergence and tilt error (3,) of the last image; 0 where it is not measured or too old."""
        visual, stale_s = state.visual, self._p.stale_after_s
        # An error measured before the landing is of the eyes as they were.
        if visual is None or visual.stamp_s <= self._landed_s or state.now_s - visual.stamp_s > stale_s:
            self._slope = np.zeros(3)
            return np.zeros(3)
        left, right, tilt = visual.error_rad
        pans = [error for error in (left, right) if math.isfinite(error)]
        both = len(pans) == 2
        version = float(np.mean(pans)) if pans else 0.0
        errors = np.nan_to_num(np.array([version, right - left if both else 0.0, tilt]))
        if visual.stamp_s > self._stamp_s:
            interval_s = visual.stamp_s - self._stamp_s
            self._slope = (errors - self._before) / interval_s if interval_s < stale_s else np.zeros(3)
            self._before, self._stamp_s = errors, visual.stamp_s
        return errors
