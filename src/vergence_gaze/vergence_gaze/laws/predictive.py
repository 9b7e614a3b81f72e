"""This project's law: straight to where the target will be when the eyes arrive, play compensated, then rest."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.joints.servo_inverse import ServoInverse
from vergence_gaze.laws.protocol import ControlInput, target_residual
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase
from vergence_rig.parameters import Parameters, parameter
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PredictiveParameters(Parameters):
    """How smoothly a moving target is followed."""

    full_correction_sigma: float = parameter(
        3.0,
        "prediction error of a moving target, in standard deviations of its estimate, that is corrected in full; "
        "smaller errors in proportion",
        minimum=0.1,
        maximum=100,
    )
    minimum_correction: float = parameter(
        0.2, "least share of a moving target's prediction error that each cycle corrects", minimum=0, maximum=1
    )


class PredictiveLaw:
    """Commands the predicted target: in a saccade as it will be at the landing, else at the command's effect."""

    name = "predictive"
    Parameters = PredictiveParameters
    unsigned = False
    lands_at_rest = False

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._p = parameters.of_law(PredictiveParameters)
        self._inverse = ServoInverse(rig, parameters.servo)
        self._aim: Array | None = None

    def reset(self) -> None:
        """Forget each joint's last direction and the aim."""
        self._inverse.reset()
        self._aim = None

    def compute_command(self, state: ControlInput) -> Array:
        """Return the joint angles (3,) to command."""
        effect_s = state.now_s + state.lead_s
        expected = state.target.at(effect_s)
        target = expected.joints_rad
        if state.phase is Phase.SACCADE:
            travel = np.abs(target - state.shaft_rad) / state.speed_rad_s
            target = state.target.at(effect_s + float(travel[state.driven].max(initial=0.0))).joints_rad
            self._aim = None
        elif expected.moving:
            target = self._aim = self._smoothed(expected, state.elapsed_s)
        else:
            self._aim = None
        target = state.joint_goal(target)
        target[~state.driven] = np.nan
        return self._inverse.command(target, state.shaft_rad, state.commanded_rad, state.half_play_rad)

    def _smoothed(self, expected: TargetEstimate, elapsed_s: float) -> Array:
        """Return the aim (3,) at a moving target: along with it, and towards it as far as the error is significant."""
        if self._aim is None:
            return expected.joints_rad
        along = self._aim + expected.joint_rates_rad_s * elapsed_s
        off = expected.joints_rad - along
        significance = np.abs(off) / (self._p.full_correction_sigma * expected.joint_sigmas_rad)
        return along + np.clip(significance, self._p.minimum_correction, 1.0) * off

    def residual(self, state: ControlInput) -> Array:
        """Return how far each driven joint (3,) is from the target now."""
        return target_residual(state)

    def remaining_rad(self) -> float:
        """Return 0: this law relies on the signed error."""
        return 0.0
