"""Olson and Coombs, "Real-time vergence control for binocular robots" (1991): PD vergence, bang-bang saccades.

Gaze and vergence angle are controlled apart: disparity drives the vergence through a PD rule, the target's place in the
image drives gaze through saccades at full speed and, between them, through a PD rule of its own. The error is the last
image's; nothing is predicted, so the gains have to be small enough for the latency.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.laws.protocol import LawView, target_residual
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_VERGENCE_GAIN = 4.0
_VERGENCE_DAMPING = 0.05
_GAZE_GAIN = 4.0
_GAZE_DAMPING = 0.05
_STALE_S = 0.3


class PdBangbangLaw:
    """Rates from errors (gains in 1/s), saccades to where the target was seen."""

    name = "pd_bangbang"
    unsigned = False
    lands_at_rest = True

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the last error and any saccade under way."""
        self._stamp_s = -math.inf
        self._before = self._slope = np.zeros(3)
        self._landing: Array | None = None
        self._landed_s = -math.inf

    def wanted(self, view: LawView) -> Array:
        """Return the joint angles (3,) to command."""
        if view.phase is Phase.SACCADE:
            if self._landing is None:
                self._landing = view.target.at(view.target.time_s).joints_rad
            return np.where(view.driven, view.goal(self._landing), np.nan)
        if self._landing is not None:
            self._landing, self._landed_s = None, view.now_s
        errors = self._errors(view)
        gains = np.array([_GAZE_GAIN, _VERGENCE_GAIN, _GAZE_GAIN])
        dampings = np.array([_GAZE_DAMPING, _VERGENCE_DAMPING, _GAZE_DAMPING])
        version, vergence, tilt = (gains * (errors + dampings * self._slope)) * view.elapsed_s
        return view.turned(version, vergence, tilt)

    def residual(self, view: LawView) -> Array:
        """Return how far each driven joint (3,) is from the target now."""
        return target_residual(view)

    def remaining_rad(self) -> float:
        """Return 0: the signed error says it."""
        return 0.0

    def _errors(self, view: LawView) -> Array:
        """Return version, vergence and tilt error (3,) of the last image; 0 where it did not tell, or is too old."""
        visual = view.visual
        # What was seen before the landing is of the eyes as they were.
        if visual is None or visual.stamp_s <= self._landed_s or view.now_s - visual.stamp_s > _STALE_S:
            self._slope = np.zeros(3)
            return np.zeros(3)
        left, right, tilt = visual.error_rad
        pans = [error for error in (left, right) if math.isfinite(error)]
        both = len(pans) == 2
        version = float(np.mean(pans)) if pans else 0.0
        errors = np.nan_to_num(np.array([version, right - left if both else 0.0, tilt]))
        if visual.stamp_s > self._stamp_s:
            interval_s = visual.stamp_s - self._stamp_s
            self._slope = (errors - self._before) / interval_s if interval_s < _STALE_S else np.zeros(3)
            self._before, self._stamp_s = errors, visual.stamp_s
        return errors
