"""A goal of FollowJointTrajectory: whether the joints keep to the trajectory, and how it has ended."""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from vergence_servo.trajectory import Trajectory

LATE_S = 1.0
"""How long after its end a trajectory may be late, where the goal states nothing [s]."""
GOAL_TOLERANCE_RAD = 0.02
"""How far from its last point a joint may be at the end, where the goal states nothing [rad]."""


class Ending(enum.IntEnum):
    """How a goal ends; the numbers are the error codes of control_msgs/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


@dataclass(frozen=True)
class Tolerances:
    """Largest errors by joint [rad]: on the way, and at the end; and how long after the end that is waited for [s].

    A joint that is left out has none on the way and GOAL_TOLERANCE_RAD at the end; infinity allows anything.
    """

    path_rad: Mapping[str, float] = field(default_factory=dict)
    goal_rad: Mapping[str, float] = field(default_factory=dict)
    late_s: float = LATE_S


@dataclass(frozen=True)
class Errors:
    """Where the joints should be, where they are, and the difference (desired - actual) [rad], by joint."""

    desired_rad: Mapping[str, float]
    actual_rad: Mapping[str, float]

    @property
    def error_rad(self) -> dict[str, float]:
        """Desired less actual angles."""
        return {name: desired - self.actual_rad[name] for name, desired in self.desired_rad.items()}


class TrajectoryGoal:
    """One trajectory under way. Times are of one clock [s].

    Args:
        trajectory: what is followed.
        begin_s: when it begins.
        tolerances: how far the joints may be off.

    Attributes:
        trajectory: as above.
        end_s: when its last point is due.
    """

    def __init__(self, trajectory: Trajectory, begin_s: float, tolerances: Tolerances) -> None:
        self.trajectory, self._begin_s, self._tolerances = trajectory, begin_s, tolerances
        self.end_s = begin_s + trajectory.duration_s

    def errors(self, now_s: float, positions_rad: Mapping[str, float]) -> Errors:
        """Return where the trajectory's joints should be and are, `positions_rad` being those of all joints."""
        desired = self.trajectory.positions_rad(now_s - self._begin_s)
        return Errors(desired, {name: positions_rad[name] for name in desired})

    def update(self, now_s: float, positions_rad: Mapping[str, float]) -> tuple[Ending, str] | None:
        """Return how the goal has ended and why; None while it goes on."""
        limits, errors = self._tolerances, self.errors(now_s, positions_rad).error_rad
        if now_s < self.end_s:
            off = _beyond(errors, limits.path_rad, math.inf)
            return (Ending.PATH_TOLERANCE_VIOLATED, f"on the way {off}") if off else None
        off = _beyond(errors, limits.goal_rad, GOAL_TOLERANCE_RAD)
        if not off:
            return Ending.SUCCESSFUL, "the joints are at the last point"
        if now_s < self.end_s + limits.late_s:
            return None
        return Ending.GOAL_TOLERANCE_VIOLATED, f"{now_s - self.end_s:.2f} s after the end {off}"


def tolerance_rad(value: float) -> float | None:
    """Return the tolerance [rad] that a JointTolerance states: None for 0, nothing stated; infinity for -1, any error.

    Raises ValueError for NaN.
    """
    if math.isnan(value):
        raise ValueError(f"a tolerance must be a number of rad, 0 for the default or -1 for none: got {value}")
    if value == 0:
        return None
    return math.inf if value < 0 else value


def _beyond(errors_rad: Mapping[str, float], limits_rad: Mapping[str, float], otherwise_rad: float) -> str:
    for name, error_rad in errors_rad.items():
        limit_rad = limits_rad.get(name, otherwise_rad)
        if not abs(error_rad) <= limit_rad:
            return f"{name} is {abs(error_rad):.4f} rad off, by more than {limit_rad:g} rad"
    return ""
