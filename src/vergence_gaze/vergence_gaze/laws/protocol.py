"""What a control law is: from what is known of target and joints to the joint angles to command."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.target_filter import TargetFilter
from vergence_gaze.phases import Phase

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class VisualError:
    """The newest sighting of the target: where it was and how far the axes were from it, by joint (3,) [rad].

    `target_rad` are the joint angles that would have fixated it, `error_rad` those minus the shafts' at the stamp. A
    joint whose error was not measured is NaN: the right pan while only the left eye sees the target.
    """

    stamp_s: float
    target_rad: Array
    error_rad: Array


@dataclass(frozen=True)
class Contrast:
    """The newest unsigned judgement of vergence: contrast and metric I [px], and the vergence it was seen at [rad].

    `resting` is False if the eyes were turning too fast for the pair to count.
    """

    stamp_s: float
    contrast: float
    metric_px: float
    vergence_rad: float
    resting: bool


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
    contrast: Contrast | None
    shaft_rad: Array
    commanded_rad: Array
    driven: npt.NDArray[np.bool_]
    speed_rad_s: Array
    lead_s: float

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

    def turned(self, version_rad: float, vergence_rad: float, tilt_rad: float) -> Array:
        """Return the last command (3,) turned by these angles [rad]; with an eye held, vergence is all the other's."""
        left, right = bool(self.driven[0]), bool(self.driven[1])
        if left and right:
            turn = (version_rad - 0.5 * vergence_rad, version_rad + 0.5 * vergence_rad, tilt_rad)
        else:
            turn = (-vergence_rad, vergence_rad, tilt_rad)
        return np.where(self.driven, self.commanded_rad + turn, np.nan)


class Law(Protocol):
    """One way to turn the eyes. Limits are not its business: what it wants is held to them afterwards."""

    name: str
    unsigned: bool
    """True if the law finds the vergence without signed disparity; `remaining_rad` then stands in for the error."""

    lands_at_rest: bool
    """True if a saccade ends where it was begun for, False if the eyes go on with a target that moves."""

    def reset(self) -> None:
        """Begin anew: a new target, or the eyes were moved by something else."""

    def wanted(self, view: LawView) -> Array:
        """Return the joint angles (3,) to command; NaN leaves a joint alone."""

    def residual(self, view: LawView) -> Array:
        """Return how far each driven joint (3,) still has to turn [rad], 0 for those not driven."""

    def remaining_rad(self) -> float:
        """Return how far from the best vergence the law believes to be; infinite while it does not know."""


def target_residual(view: LawView) -> Array:
    """Return how far each driven joint (3,) is from the filter's target now."""
    return np.where(view.driven, view.goal(view.target.at(view.now_s).joints_rad) - view.shaft_rad, 0.0)
