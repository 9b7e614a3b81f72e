"""Goals of FollowJointTrajectory: tolerances on the way and at the end, and how a goal ends."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_servo.trajectory import Trajectory, TrajectoryPoint
from vergence_servo.trajectory_goal import (
    GOAL_TOLERANCE_RAD,
    LATE_S,
    Ending,
    Tolerances,
    TrajectoryGoal,
    tolerance_rad,
)

BEGIN_S, END_RAD = 5.0, 0.4


def goal(**tolerances: object) -> TrajectoryGoal:
    trajectory = Trajectory(["tilt"], [TrajectoryPoint(2.0, (END_RAD,))], {"tilt": 0.0, "pan_left": 0.0})
    return TrajectoryGoal(trajectory, BEGIN_S, Tolerances(**tolerances))  # type: ignore[arg-type]


def at(tilt_rad: float) -> dict[str, float]:
    return {"tilt": tilt_rad, "pan_left": 1.0}


@given(st.floats(0.0, 1.99))
def test_nothing_stated_allows_any_error_on_the_way(time_s: float) -> None:
    assert goal().update(BEGIN_S + time_s, at(3.0)) is None


def test_joints_at_the_last_point_succeed_as_soon_as_they_are_there() -> None:
    one = goal()
    assert one.update(BEGIN_S + 2.0, at(END_RAD - 2.0 * GOAL_TOLERANCE_RAD)) is None
    ended = one.update(BEGIN_S + 2.1, at(END_RAD - 0.5 * GOAL_TOLERANCE_RAD))
    assert ended is not None
    assert ended[0] is Ending.SUCCESSFUL


def test_joints_that_do_not_arrive_violate_the_goal_s_tolerance() -> None:
    ended = goal().update(BEGIN_S + 2.0 + LATE_S + 0.01, at(0.3))
    assert ended is not None
    assert ended[0] is Ending.GOAL_TOLERANCE_VIOLATED
    assert "tilt is 0.1000 rad off, by more than 0.02 rad" in ended[1]


def test_stated_tolerances_hold() -> None:
    one = goal(path_rad={"tilt": 0.05}, goal_rad={"tilt": 0.2}, late_s=0.1)
    assert one.update(BEGIN_S + 1.0, at(0.2 + 0.049)) is None
    ended = one.update(BEGIN_S + 1.0, at(0.2 + 0.051))
    assert ended is not None
    assert ended[0] is Ending.PATH_TOLERANCE_VIOLATED
    assert one.update(BEGIN_S + 2.0, at(END_RAD - 0.19)) == (Ending.SUCCESSFUL, "the joints are at the last point")
    erased = goal(goal_rad={"tilt": math.inf})
    assert erased.update(BEGIN_S + 2.0, at(9.0)) == (Ending.SUCCESSFUL, "the joints are at the last point")


def test_a_position_that_is_no_number_is_no_success() -> None:
    assert goal().update(BEGIN_S + 2.5, at(math.nan)) is None
    ended = goal(path_rad={"tilt": 0.1}).update(BEGIN_S + 1.0, at(math.nan))
    assert ended is not None
    assert ended[0] is Ending.PATH_TOLERANCE_VIOLATED


def test_errors_are_of_the_trajectory_s_joints() -> None:
    errors = goal().errors(BEGIN_S + 1.0, at(0.15))
    assert errors.desired_rad == {"tilt": pytest.approx(0.2)}
    assert errors.actual_rad == {"tilt": 0.15}
    assert errors.error_rad == {"tilt": pytest.approx(0.05)}


def test_what_a_tolerance_of_the_message_means() -> None:
    assert [tolerance_rad(value) for value in (0.0, 0.1, -1.0)] == [None, 0.1, math.inf]
    with pytest.raises(ValueError, match="tolerance must be a number"):
        tolerance_rad(math.nan)
