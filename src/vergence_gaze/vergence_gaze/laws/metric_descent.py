"""The paper's own idea: turn one eye until the unsigned metric is least.

The left eye is put on the target by its direction alone. The metric has a basin about a degree wide, so the right eye
first sweeps over all vergence angles and notes the contrast of every pair with the vergence it was seen at; then it
goes to the best and walks downhill in ever smaller steps, resting for a look at each.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.joints.servo_inverse import ServoInverse
from vergence_gaze.laws.protocol import Contrast, LawView
from vergence_gaze.parameters import GazeParameters
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_NEAREST_M = 0.22
_SWEEP_RAD_S = math.radians(16.0)
_FIRST_STEP_RAD = math.radians(0.5)
_LAST_STEP_RAD = math.radians(0.12)
_WORSE = 0.12


class MetricDescentLaw:
    """Sweeps, then descends; starts over when the contrast it had found is gone."""

    name = "metric_descent"
    unsigned = True
    lands_at_rest = False

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._inverse = ServoInverse(rig, parameters.hold_tolerance_rad, parameters.dead_band_trust)
        self._widest_rad = 2.0 * math.atan(0.5 * rig.baseline_m / _NEAREST_M)
        self._floor_rad = rig.minimum_vergence_rad
        self._good = parameters.contrast_enter
        self._gone = parameters.contrast_leave
        self.reset()

    def reset(self) -> None:
        """Begin with a sweep."""
        self._inverse.reset()
        self._sweep: list[tuple[float, float]] = []
        self._vergence_rad = math.nan
        self._sweeping = True
        self._best: tuple[float, float] | None = None
        self._step_rad = _FIRST_STEP_RAD
        self._tried_other_side = False
        self._looked_s = -math.inf
        self._arrived_s = math.nan

    def wanted(self, view: LawView) -> Array:
        """Return the joint angles (3,) to command."""
        left_pan, _, tilt = view.target.at(view.now_s + view.lead_s).joints_rad
        if math.isnan(self._vergence_rad):
            self._vergence_rad = self._widest_rad
        self._look(view)
        if self._sweeping and self._at(view, self._vergence_rad, 0.05):
            self._vergence_rad = max(self._vergence_rad - _SWEEP_RAD_S * view.elapsed_s, self._floor_rad)
            if self._vergence_rad <= self._floor_rad:
                self._end_sweep()
        target = view.goal(np.array([left_pan, left_pan + self._vergence_rad, tilt]))
        target[~view.driven] = np.nan
        return self._inverse.command(target, view.shaft_rad, view.commanded_rad)

    def residual(self, view: LawView) -> Array:
        """Return how far the left eye and the tilt are from the target (3,); the right eye searches."""
        residual = view.target.at(view.now_s).joints_rad - view.shaft_rad
        residual[1] = 0.0
        return np.where(view.driven, residual, 0.0)

    def remaining_rad(self) -> float:
        """Return the step that is left to try; infinite while sweeping."""
        if self._sweeping or self._best is None:
            return math.inf
        return 0.0 if self._step_rad <= _LAST_STEP_RAD else self._step_rad

    def _look(self, view: LawView) -> None:
        contrast = view.contrast
        if contrast is None or contrast.stamp_s <= self._looked_s or not math.isfinite(contrast.contrast):
            return
        if self._sweeping:
            self._looked_s = contrast.stamp_s
            if contrast.resting:
                self._sweep.append((contrast.contrast, contrast.vergence_rad))
            return
        if not contrast.resting or not self._seen_at_rest(view, contrast):
            return
        self._looked_s = contrast.stamp_s
        self._descend(contrast, view.now_s)

    def _seen_at_rest(self, view: LawView, contrast: Contrast) -> bool:
        """Tell whether the pair was exposed after the eyes arrived where the law had sent them."""
        if math.isnan(self._arrived_s):
            if self._at(view, self._vergence_rad, 0.004):
                self._arrived_s = view.now_s
            return False
        return contrast.stamp_s > self._arrived_s

    def _at(self, view: LawView, vergence_rad: float, tolerance_rad: float) -> bool:
        return abs(float(view.shaft_rad[1] - view.shaft_rad[0]) - vergence_rad) < tolerance_rad

    def _end_sweep(self) -> None:
        self._sweeping = False
        if not self._sweep:
            self.reset()
            return
        _, self._vergence_rad = min(self._sweep)
        self._best, self._step_rad, self._tried_other_side = None, _FIRST_STEP_RAD, False
        self._arrived_s = math.nan

    def _descend(self, seen: Contrast, now_s: float) -> None:
        here = (seen.contrast, seen.vergence_rad)
        if self._best is None:
            self._best = here
            self._go(seen.vergence_rad + self._step_rad)
        elif abs(self._step_rad) <= _LAST_STEP_RAD:
            if seen.contrast > max(self._gone, self._best[0] + 3.0 * _WORSE):
                self.reset()
        elif here[0] < self._best[0]:
            self._best, self._tried_other_side = here, True
            self._go(seen.vergence_rad + self._step_rad)
        elif not self._tried_other_side:
            self._tried_other_side = True
            self._step_rad = -self._step_rad
            self._go(self._best[1] + self._step_rad)
        else:
            self._step_rad *= -0.5
            self._tried_other_side = False
            settled = abs(self._step_rad) <= _LAST_STEP_RAD
            self._step_rad = abs(self._step_rad) if settled else self._step_rad
            self._go(self._best[1] + (0.0 if settled else self._step_rad))

    def _go(self, vergence_rad: float) -> None:
        self._vergence_rad = max(vergence_rad, self._floor_rad)
        self._arrived_s = math.nan
