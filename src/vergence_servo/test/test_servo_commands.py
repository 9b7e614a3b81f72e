"""Which commands are accepted, how trajectories run, and which nodes command."""

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_servo.command_guard import (
    CommandRefusedError,
    MalformedCommandError,
    OutOfOrderError,
    StaleCommandError,
    StampGuard,
    StampLimits,
    UnknownJointError,
    named_positions,
    ordered_positions,
)
from vergence_servo.commanders import Commander, conflict
from vergence_servo.trajectory import Trajectory, TrajectoryPoint, check_end, start_delay_s

JOINTS = ("pan_left", "pan_right", "tilt")
S = 1_000_000_000


@pytest.fixture
def stamps() -> StampGuard:
    return StampGuard(StampLimits(max_age_s=0.5, max_ahead_s=0.1, forget_s=0.5))


def test_names_may_come_in_any_order_and_be_few():
    assert named_positions(["tilt", "pan_left"], [0.1, 0.2], JOINTS) == {"tilt": 0.1, "pan_left": 0.2}
    assert ordered_positions([1, 2, 3], JOINTS) == {"pan_left": 1.0, "pan_right": 2.0, "tilt": 3.0}


@pytest.mark.parametrize(
    ("names", "positions", "kind"),
    [
        ([], [], MalformedCommandError),
        (["tilt"], [], MalformedCommandError),
        (["tilt"], [0.1, 0.2], MalformedCommandError),
        (["tilt", "tilt"], [0.1, 0.2], MalformedCommandError),
        (["tilt"], [math.nan], MalformedCommandError),
        (["tilt"], [math.inf], MalformedCommandError),
        (["tilt", "neck"], [0.1, 0.2], UnknownJointError),
        (["Tilt"], [0.1], UnknownJointError),
    ],
)
def test_commands_that_do_not_fit_are_refused_whole(names: list[str], positions: list[float], kind: type[Exception]):
    with pytest.raises(kind):
        named_positions(names, positions, JOINTS)


@settings(deadline=None, max_examples=200)
@given(names=st.lists(st.text(max_size=8) | st.sampled_from(JOINTS)), positions=st.lists(st.floats()))
def test_whatever_is_taken_is_finite_and_known(names: list[str], positions: list[float]):
    try:
        taken = named_positions(names, positions, JOINTS)
    except CommandRefusedError:
        return
    assert set(taken) <= set(JOINTS)
    assert all(math.isfinite(value) for value in taken.values())


def test_stale_and_future_stamps_are_refused(stamps: StampGuard):
    with pytest.raises(StaleCommandError, match=r"got 0\.600 s"):
        stamps.check(100 * S, 100 * S + 6 * S // 10)
    with pytest.raises(StaleCommandError, match=r"ahead: got 0\.200 s"):
        stamps.check(100 * S + 2 * S // 10, 100 * S)
    stamps.check(100 * S, 100 * S + S // 10)


def test_stamps_must_rise_until_the_sender_has_been_silent(stamps: StampGuard):
    stamps.check(100 * S, 100 * S)
    with pytest.raises(OutOfOrderError, match=r"0\.100 s before"):
        stamps.check(100 * S - S // 10, 100 * S + 1000)
    stamps.check(100 * S, 100 * S + 2000)  # the same stamp again is no step back
    # a sender whose clock was set back by a little may speak again after the time-out
    stamps.check(100 * S + 3 * S // 10, 100 * S + 6 * S // 10)


def test_senders_that_do_not_stamp_are_taken(stamps: StampGuard):
    stamps.check(0, 100 * S)


def test_unchecked_stamps_may_be_of_any_age():
    guard = StampGuard(StampLimits(0.0, 0.0, 0.5))
    guard.check(1, 100 * S)
    guard.check(500 * S, 101 * S)


def test_a_trajectory_starts_where_the_joints_are_and_ends_at_its_last_point():
    points = [TrajectoryPoint(1.0, (0.5,)), TrajectoryPoint(2.0, (0.3,))]
    trajectory = Trajectory(["tilt"], points, {"pan_left": 1.0, "tilt": 0.1})
    assert trajectory.duration_s == 2.0
    assert [trajectory.positions_rad(t)["tilt"] for t in (-1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 9.0)] == pytest.approx(
        [0.1, 0.1, 0.3, 0.5, 0.4, 0.3, 0.3]
    )


def test_velocities_make_a_cubic():
    points = [TrajectoryPoint(0.0, (0.0,), (0.0,)), TrajectoryPoint(2.0, (1.0,), (0.0,))]
    trajectory = Trajectory(["tilt"], points, {"tilt": 0.0})
    assert trajectory.positions_rad(1.0)["tilt"] == pytest.approx(0.5)
    assert trajectory.positions_rad(0.5)["tilt"] == pytest.approx(3 * 0.25**2 - 2 * 0.25**3)
    step = 1e-6
    assert (trajectory.positions_rad(step)["tilt"]) / step == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(
    ("joints", "points", "text"),
    [
        ([], [TrajectoryPoint(1.0, ())], "joint_names"),
        (["tilt", "tilt"], [TrajectoryPoint(1.0, (0.0, 0.0))], "once"),
        (["neck"], [TrajectoryPoint(1.0, (0.0,))], "'neck'"),
        (["tilt"], [], "got none"),
        (["tilt"], [TrajectoryPoint(1.0, (0.0,)), TrajectoryPoint(1.0, (0.0,))], "must increase"),
        (["tilt"], [TrajectoryPoint(-1.0, (0.0,))], "must increase"),
        (["tilt"], [TrajectoryPoint(1.0, (0.0, 1.0))], "got 2"),
        (["tilt"], [TrajectoryPoint(1.0, (math.nan,))], "finite"),
        (["tilt"], [TrajectoryPoint(1.0, (0.0,), (math.inf,))], "velocities"),
    ],
)
def test_trajectories_that_do_not_fit_are_refused(joints: list[str], points: list[Any], text: str):
    with pytest.raises(CommandRefusedError, match=text):
        Trajectory(joints, points, {"tilt": 0.0})


def test_two_commanders_are_named():
    one, other = Commander("/gaze", b"1"), Commander("/teleop", b"2")
    assert conflict({"joint_command": []}) == ""
    assert conflict({"joint_command": [one]}) == ""
    assert conflict({"joint_command": [one], "joint_trajectory": [Commander("/gaze", b"9")]}) == ""
    assert "2 commanders" in conflict({"joint_command": [one, other]})
    assert "/teleop on joint_trajectory" in conflict({"joint_command": [one], "joint_trajectory": [other]})
    twins = [Commander("/gaze", b"1"), Commander("/gaze", b"2")]
    assert "2 commanders" in conflict({"joint_command": twins})


def test_trajectories_begin_at_their_stamp_and_end_in_time():
    assert start_delay_s(0, 100 * S, 0.5) == 0.0
    assert start_delay_s(102 * S, 100 * S, 0.5) == pytest.approx(2.0)
    assert start_delay_s(50 * S, 100 * S, 0.0) == pytest.approx(-50.0)
    with pytest.raises(StaleCommandError, match=r"began 1\.000 s ago"):
        start_delay_s(99 * S, 100 * S, 0.5)
    check_end(60.0, 60.0)
    with pytest.raises(MalformedCommandError, match=r"end in 1000000000\.0 s"):
        check_end(1e9, 60.0)
