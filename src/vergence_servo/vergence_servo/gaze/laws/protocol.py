"""What a control law is: from what is known of target and joints to the joint angles to command."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vergence_servo.gaze.phases import Phase
from vergence_servo.gaze.target_filter import TargetFilter

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class VisualError:
    """The newest measurement as it was seen: joint angles (3,) to the target minus the shafts' at the stamp [rad].

    A joint whose error was not measured is NaN: the right pan while only the left eye sees the target.
    """

    stamp_s: float
    error_rad: Array


@dataclass(frozen=True)
class LawView:
    """All that a law may look at. Joint angles are (3,): pan_left, pan_right, tilt [rad].

    `shaft_rad` are the estimated shafts now, `commanded_rad` the last command; `driven` says which joints may move;
    `lead_s` is the time from a command to its effect; `target` has been initialised.
    """

    now_s: float
    elapsed_s: float
    phase: Phase
    target: TargetFilter
    visual: VisualError | None
    contrast: float
    metric_px: float
    contrast_s: float
    shaft_rad: Array
    commanded_rad: Array
    driven: npt.NDArray[np.bool_]
    speed_rad_s: Array
    lead_s: float
    minimum_vergence_rad: float

    def goal(self, target_rad: Array) -> Array:
        """Return where the joints (3,) have to go for a target at the joint angles `target_rad` (3,).

        A held eye looks past the target by what it is off; the free eye has to look past it by the same, or the two
        images would not agree: vergence is of the eyes with each other.
        """
        goal = target_rad.copy()
        left, right = bool(self.driven[0]), bool(self.driven[1])
        if left != right:
            held = 1 if left else 0
            goal[:2] += self.shaft_rad[held] - target_rad[held]
        return goal


class Law(Protocol):
    """One way to turn the eyes. Limits are not its business: what it wants is held to them afterwards."""

    name: str

    def reset(self) -> None:
        """Begin anew: a new target, or the eyes were moved by something else."""

    def wanted(self, view: LawView) -> Array:
        """Return the joint angles (3,) to command; NaN leaves a joint alone."""

    def residual(self, view: LawView) -> Array:
        """Return how far each driven joint (3,) still has to turn [rad], 0 for those not driven."""
