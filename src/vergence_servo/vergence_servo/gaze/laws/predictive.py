"""Our law: straight to where the target will be when the eyes arrive, past what the servo swallows, then rest."""

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig
from vergence_servo.gaze.laws.protocol import LawView, target_residual
from vergence_servo.gaze.parameters import GazeParameters
from vergence_servo.gaze.phases import Phase
from vergence_servo.gaze.servo_inverse import ServoInverse

Array = npt.NDArray[np.float64]


class PredictiveLaw:
    """Commands the predicted target: in a saccade as it will be at the landing, else at the command's effect."""

    name = "predictive"
    unsigned = False

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._inverse = ServoInverse(rig, parameters.hold_tolerance_rad, parameters.dead_band_trust)

    def reset(self) -> None:
        """Forget which way the joints came."""
        self._inverse.reset()

    def wanted(self, view: LawView) -> Array:
        """Return the joint angles (3,) to command."""
        ahead_s = view.lead_s
        target = view.target.at(view.now_s + ahead_s).joints_rad
        if view.phase is Phase.SACCADE:
            travel = np.abs(target - view.shaft_rad) / view.speed_rad_s
            target = view.target.at(view.now_s + ahead_s + float(travel[view.driven].max(initial=0.0))).joints_rad
        target = view.goal(target)
        target[~view.driven] = np.nan
        return self._inverse.command(target, view.shaft_rad, view.commanded_rad)

    def residual(self, view: LawView) -> Array:
        """Return how far each driven joint (3,) is from the target now."""
        return target_residual(view)

    def remaining_rad(self) -> float:
        """Return 0: the signed error says it."""
        return 0.0
