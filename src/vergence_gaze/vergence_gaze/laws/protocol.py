"""What a control law is: from the state of target and joints to the joint angles to command."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.target_filter import TargetFilter
from vergence_gaze.estimation.visual_error import ContrastSample, VisualError
from vergence_gaze.phases import Phase

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ControlInput:
    """The input of a law in one control cycle. Joint angles are (3,): pan_left, pan_right, tilt [rad].

    `shaft_rad` are the estimated shafts now, `commanded_rad` the last command; `driven` says which joints may move;
    `lead_s` is the time from a command to its effect, `half_play_rad` half of each joint's dead band and backlash;
    `target` has been initialised.
    """

    now_s: float
    elapsed_s: float
    phase: Phase
    target: TargetFilter
    visual: VisualError | None
    contrast: ContrastSample | None
    shaft_rad: Array
    commanded_rad: Array
    driven: npt.NDArray[np.bool_]
    speed_rad_s: Array
    lead_s: float
    half_play_rad: Array

    def joint_goal(self, target_rad: Array) -> Array:
        """Return where the joints (3,) have to go for a target at the joint angles `target_rad` (3,).

        A held eye looks past the target by its own error; the free eye has to look past it by the same, or the two
        images would not agree: vergence is of the eyes with each other.
        """
        goal = target_rad.copy()
        left, right = bool(self.driven[0]), bool(self.driven[1])
        if left != right:
            held = 1 if left else 0
            goal[:2] += self.shaft_rad[held] - target_rad[held]
        return goal

    def turned(self, version_rad: float, vergence_rad: float, tilt_rad: float) -> Array:
        """Return the last command (3,) turned by these angles [rad]; a free eye beside a held one turns by vergence."""
        left, right = bool(self.driven[0]), bool(self.driven[1])
        if left and right:
            turn = (version_rad - 0.5 * vergence_rad, version_rad + 0.5 * vergence_rad, tilt_rad)
        else:
            turn = (-vergence_rad, vergence_rad, tilt_rad)
        return np.where(self.driven, self.commanded_rad + turn, np.nan)


class Law(Protocol):
    """One way to turn the eyes. Commands are limited afterwards, not by the law.

    A law's class is built as `law(rig, parameters)` and has an attribute `Parameters`, the class of its own parameters;
    `GazeParameters.of_law` returns their values.
    """

    name: str
    """Its name in the parameter `law` and the prefix of its own parameters."""

    unsigned: bool
    """True if the law finds the vergence without signed disparity; `remaining_rad` then stands in for the error."""

    lands_at_rest: bool
    """True if a saccade ends where the target was at its start, False if the eyes go on with a moving target."""

    def reset(self) -> None:
        """Start again: a new target, or the joints were moved by something else."""

    def compute_command(self, state: ControlInput) -> Array:
        """Return the joint angles (3,) to command; NaN leaves a joint where it is."""

    def residual(self, state: ControlInput) -> Array:
        """Return how far each driven joint (3,) still has to turn [rad], 0 for those not driven."""

    def remaining_rad(self) -> float:
        """Return the law's own estimate of the distance from the best vergence; infinite while there is none."""


def target_residual(state: ControlInput) -> Array:
    """Return how far each driven joint (3,) is from the filter's target now."""
    return np.where(state.driven, state.joint_goal(state.target.at(state.now_s).joints_rad) - state.shaft_rad, 0.0)
