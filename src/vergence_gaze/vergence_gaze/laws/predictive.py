"""Our law: straight to where the target will be when the eyes arrive, past what the servo swallows, then rest."""

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.target_filter import TargetEstimate
from vergence_gaze.joints.servo_inverse import ServoInverse
from vergence_gaze.laws.protocol import LawView, target_residual
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_DOUBTS = 3.0
_LEAST_SHARE = 0.2


class PredictiveLaw:
    """Commands the predicted target: in a saccade as it will be at the landing, else at the command's effect."""

    name = "predictive"
    unsigned = False
    lands_at_rest = False

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._inverse = ServoInverse(rig, parameters.hold_tolerance_rad, parameters.dead_band_trust)
        self._aim: Array | None = None

    def reset(self) -> None:
        """Forget which way the joints came."""
        self._inverse.reset()
        self._aim = None

    def wanted(self, view: LawView) -> Array:
        """Return the joint angles (3,) to command."""
        effect_s = view.now_s + view.lead_s
        expected = view.target.at(effect_s)
        target = expected.joints_rad
        if view.phase is Phase.SACCADE:
            travel = np.abs(target - view.shaft_rad) / view.speed_rad_s
            target = view.target.at(effect_s + float(travel[view.driven].max(initial=0.0))).joints_rad
            self._aim = None
        elif expected.moving:
            target = self._aim = self._smoothly(expected, view.elapsed_s)
        else:
            self._aim = None
        target = view.goal(target)
        target[~view.driven] = np.nan
        return self._inverse.command(target, view.shaft_rad, view.commanded_rad)

    def _smoothly(self, expected: TargetEstimate, elapsed_s: float) -> Array:
        """Return where to aim (3,) at a moving target: along with it, and over to it as far as that is no doubt."""
        if self._aim is None:
            return expected.joints_rad
        along = self._aim + expected.joint_rates_rad_s * elapsed_s
        off = expected.joints_rad - along
        share = np.clip(np.abs(off) / (_DOUBTS * expected.joint_sigmas_rad), _LEAST_SHARE, 1.0)
        return along + share * off

    def residual(self, view: LawView) -> Array:
        """Return how far each driven joint (3,) is from the target now."""
        return target_residual(view)

    def remaining_rad(self) -> float:
        """Return 0: the signed error says it."""
        return 0.0
