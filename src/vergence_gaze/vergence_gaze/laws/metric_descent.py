"""The paper's own idea: turn one eye until the unsigned metric is least.

The left eye is put on the target by its direction alone. The metric has a basin about a degree wide, so the right eye
first sweeps over all vergence angles and notes the contrast of every pair with the vergence it was seen at; then it
goes to the best and walks downhill in ever smaller steps, resting to look at each.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.visual_error import ContrastSample
from vergence_gaze.joints.servo_inverse import ServoInverse
from vergence_gaze.laws.protocol import ControlInput
from vergence_gaze.parameters import GazeParameters
from vergence_rig.parameters import Parameters, parameter
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_SWEEP_TOLERANCE_RAD = 0.05
_ARRIVED_RAD = 0.004


@dataclass(frozen=True)
class MetricDescentParameters(Parameters):
    """The sweep and the steps."""

    nearest_m: float = parameter(
        0.22, "distance of the nearest target: the sweep starts at its vergence", unit="m", minimum=0.05, maximum=10
    )
    sweep_speed_rad_s: float = parameter(
        0.2792526803190927, "vergence speed of the sweep", unit="rad/s", minimum=0.001, maximum=10
    )
    first_step_rad: float = parameter(
        0.008726646259971648, "first step of the descent", unit="rad", minimum=1e-4, maximum=1
    )
    last_step_rad: float = parameter(
        0.0020943951023931952, "step at which the descent ends", unit="rad", minimum=1e-5, maximum=1
    )
    contrast_noise: float = parameter(
        0.12,
        "noise of the edge contrast; a rise of three times this above the best, and above verged.contrast_leave, "
        "restarts the sweep",
        minimum=0,
        maximum=2,
    )


class MetricDescentLaw:
    """Sweeps, then descends; sweeps again once the best contrast has risen."""

    name = "metric_descent"
    Parameters = MetricDescentParameters
    unsigned = True
    lands_at_rest = False

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._p = parameters.of_law(MetricDescentParameters)
        self._inverse = ServoInverse(rig, parameters.servo)
        self._widest_rad = 2.0 * math.atan(0.5 * rig.baseline_m / self._p.nearest_m)
        self._floor_rad = rig.least_vergence_rad
        self._gone = parameters.verged.contrast_leave
        self.reset()

    def reset(self) -> None:
        """Start with a sweep."""
        self._inverse.reset()
        self._sweep: list[tuple[float, float]] = []
        self._vergence_rad = math.nan
        self._sweeping = True
        self._best: tuple[float, float] | None = None
        self._step_rad = self._p.first_step_rad
        self._tried_other_side = False
        self._looked_s = -math.inf
        self._arrived_s = math.nan

    def compute_command(self, state: ControlInput) -> Array:
        """Return the joint angles (3,) to command."""
        left_pan, _, tilt = state.target.at(state.now_s + state.lead_s).joints_rad
        if math.isnan(self._vergence_rad):
            self._vergence_rad = self._widest_rad
        self._look(state)
        if self._sweeping and self._at(state, self._vergence_rad, _SWEEP_TOLERANCE_RAD):
            self._vergence_rad = max(self._vergence_rad - self._p.sweep_speed_rad_s * state.elapsed_s, self._floor_rad)
            if self._vergence_rad <= self._floor_rad:
                self._end_sweep()
        target = state.joint_goal(np.array([left_pan, left_pan + self._vergence_rad, tilt]))
        target[~state.driven] = np.nan
        return self._inverse.command(target, state.shaft_rad, state.commanded_rad, state.half_play_rad)

    def residual(self, state: ControlInput) -> Array:
        """Return how far the left eye and the tilt are from the target (3,); the right eye searches."""
        residual = state.target.at(state.now_s).joints_rad - state.shaft_rad
        residual[1] = 0.0
        return np.where(state.driven, residual, 0.0)

    def remaining_rad(self) -> float:
        """Return the step that is left to try; infinite while sweeping."""
        if self._sweeping or self._best is None:
            return math.inf
        return 0.0 if self._step_rad <= self._p.last_step_rad else self._step_rad

    def _look(self, state: ControlInput) -> None:
        contrast = state.contrast
        if contrast is None or contrast.stamp_s <= self._looked_s or not math.isfinite(contrast.contrast):
            return
        if self._sweeping:
            self._looked_s = contrast.stamp_s
            if contrast.resting:
                self._sweep.append((contrast.contrast, contrast.vergence_rad))
            return
        if not contrast.resting or not self._measured_at_rest(state, contrast):
            return
        self._looked_s = contrast.stamp_s
        self._descend(contrast, state.now_s)

    def _measured_at_rest(self, state: ControlInput, contrast: ContrastSample) -> bool:
        """Return whether the pair was exposed after the eyes arrived at the commanded vergence."""
        if math.isnan(self._arrived_s):
            if self._at(state, self._vergence_rad, _ARRIVED_RAD):
                self._arrived_s = state.now_s
            return False
        return contrast.stamp_s > self._arrived_s

    def _at(self, state: ControlInput, vergence_rad: float, tolerance_rad: float) -> bool:
        return abs(float(state.shaft_rad[1] - state.shaft_rad[0]) - vergence_rad) < tolerance_rad

    def _end_sweep(self) -> None:
        self._sweeping = False
        if not self._sweep:
            self.reset()
            return
        _, self._vergence_rad = min(self._sweep)
        self._best, self._step_rad, self._tried_other_side = None, self._p.first_step_rad, False
        self._arrived_s = math.nan

    def _descend(self, seen: ContrastSample, now_s: float) -> None:
        here = (seen.contrast, seen.vergence_rad)
        if self._best is None:
            self._best = here
            self._go(seen.vergence_rad + self._step_rad)
        elif abs(self._step_rad) <= self._p.last_step_rad:
            if seen.contrast > max(self._gone, self._best[0] + 3.0 * self._p.contrast_noise):
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
            settled = abs(self._step_rad) <= self._p.last_step_rad
            self._step_rad = abs(self._step_rad) if settled else self._step_rad
            self._go(self._best[1] + (0.0 if settled else self._step_rad))

    def _go(self, vergence_rad: float) -> None:
        self._vergence_rad = max(vergence_rad, self._floor_rad)
        self._arrived_s = math.nan
