"""PointHead: which axes can be pointed, how far they are off, and that no joint is faster than asked."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import JointReport, Observation
from vergence_gaze.goals.goal import Goal, GoalError, GoalKind, Outcome, Result
from vergence_gaze.goals.pointing import check_axis, pointing_error_rad
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.testing.fake_head import TICK_S, FakeHead
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig

RIG = default_rig()
KINEMATICS = Kinematics(RIG)
CONTROL_TICKS = 6
POINT_M = (0.6, 0.2, -0.05)


@pytest.mark.parametrize(
    ("frame", "axis"),
    [
        ("", (0.0, 0.0, 0.0)),
        ("left_camera", (2.0, 0.0, 0.0)),
        ("right_camera_optical_frame", (0.0, 0.0, 1.0)),
        ("head/left_camera_optical_frame", (0.0, 0.0, 0.0)),
    ],
)
def test_optical_axes_can_be_pointed(frame: str, axis: tuple[float, float, float]) -> None:
    check_axis(frame, axis)


@pytest.mark.parametrize(
    ("frame", "axis", "text"),
    [
        ("tilt_link", (1.0, 0.0, 0.0), "pointing_frame must be"),
        ("", (1.0, 0.0, 0.0), "where pointing_frame is empty"),
        ("left_camera", (0.0, 0.0, 1.0), "pointing_axis must be"),
        ("left_camera", (-1.0, 0.0, 0.0), "pointing_axis must be"),
        ("left_camera", (math.nan, 0.0, 0.0), "pointing_axis must be"),
    ],
)
def test_other_axes_are_refused(frame: str, axis: tuple[float, float, float], text: str) -> None:
    with pytest.raises(GoalError, match=text) as refused:
        check_axis(frame, axis)
    assert refused.value.result is Result.INVALID


@given(x=st.floats(0.3, 3.0), y=st.floats(-0.5, 0.5), z=st.floats(-0.3, 0.3))
def test_the_error_is_0_at_the_point_and_what_the_pan_is_off_beside_it(x: float, y: float, z: float) -> None:
    eyes = KINEMATICS.gaze_for_point((x, y, z))
    at = np.array([eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad])
    assert pointing_error_rad("", (x, y, z), at, KINEMATICS) < 1e-6
    beside = at + np.array([0.0, 0.1, 0.0])
    assert pointing_error_rad("left_camera", (x, y, z), beside, KINEMATICS) < 1e-6
    off_rad = pointing_error_rad("right_camera", (x, y, z), beside, KINEMATICS)
    assert off_rad == pytest.approx(0.1, abs=1e-6)
    assert pointing_error_rad("", (x, y, z), beside, KINEMATICS) == off_rad


def pointed(images: bool = True, **pace: Any) -> tuple[Outcome, float]:
    """Return how a goal at a point ended, and the largest commanded speed until then [rad/s]."""
    head = FakeHead(RIG, lambda time_s: np.array(POINT_M), seed=2)
    controller = GazeController(RIG, gaze_parameters(), CONTROL_TICKS * TICK_S)
    arrived: list[Observation] = []
    fastest_rad_s, last, asked = 0.0, np.zeros(3), False
    while head.time_s < 20.0:
        arrived += [one for one in head.advance() if images or isinstance(one, JointReport)]
        if round(head.time_s / TICK_S) % CONTROL_TICKS:
            continue
        if head.time_s > 0.2 and not asked:
            goal = Goal(GoalKind.POINT, point_m=POINT_M, **pace)
            controller.check(goal, head.time_s)
            controller.look_at(goal, head.time_s)
            asked = True
        command = controller.step(head.time_s, arrived)
        arrived = []
        head.execute(command)
        if command.outcomes:
            return command.outcomes[0], fastest_rad_s
        if command.joints_rad is not None:
            fastest_rad_s = max(
                fastest_rad_s, float(np.abs(command.joints_rad - last).max()) / (CONTROL_TICKS * TICK_S)
            )
            last = command.joints_rad
    raise AssertionError("the goal does not end")


def test_no_joint_is_faster_than_asked() -> None:
    (free, free_rad_s), (slow, slow_rad_s) = pointed(), pointed(max_speed_rad_s=0.2)
    assert free_rad_s > 2.0
    assert slow_rad_s <= 0.2 + 1e-6
    assert {free.result, slow.result} <= {Result.VERGED, Result.AT_POINT}
    assert slow.time_s > 0.3 / 0.2 - 0.5 > free.time_s


def test_it_takes_no_less_than_the_asked_time() -> None:
    outcome, fastest_rad_s = pointed(min_duration_s=6.0)
    assert outcome.result in (Result.VERGED, Result.AT_POINT), outcome
    assert outcome.time_s > 5.5
    assert fastest_rad_s < 0.2


@pytest.mark.parametrize("pace", [{"max_speed_rad_s": -1.0}, {"max_speed_rad_s": math.nan}, {"min_duration_s": -1.0}])
def test_a_pace_that_cannot_be_is_refused(pace: dict[str, Any]) -> None:
    with pytest.raises(GoalError, match="must be"):
        pointed(**pace)


@pytest.mark.parametrize("pace", [{}, {"max_speed_rad_s": 0.1}], ids=["at full speed", "slowly"])
def test_without_images_the_joints_alone_reach_a_point_that_needs_none(pace: dict[str, Any]) -> None:
    outcome, _ = pointed(images=False, needs_images=False, **pace)
    assert outcome.result is Result.AT_POINT, outcome
    failed, _ = pointed(images=False, **pace)
    assert failed.result is Result.NO_IMAGES
