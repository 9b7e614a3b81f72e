"""control_msgs/PointHead and FollowJointTrajectory on real nodes, where control_msgs is installed.

test/system/test_standard_actions.py runs these where it is not.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from vergence_common.stamps import to_seconds
from vergence_rig.rig import JOINT_NAMES
from vergence_servo.ros.servo_node import ServoNode

from .conftest import Graph
from .test_gaze_controller_node import Scene

pytest.importorskip("control_msgs.action", reason="control_msgs is not installed")

from control_msgs.action import FollowJointTrajectory, PointHead
from control_msgs.msg import JointTolerance

pytestmark = pytest.mark.graph

POINT_M = (0.7, 0.1, 0.05)


class Client:
    """Sends goals of one action and waits for their results."""

    def __init__(self, graph: Graph, action: Any, name: str) -> None:
        self._graph, self._client = graph, ActionClient(graph.client, action, name)
        self.feedback: list[Any] = []
        graph.wait_until(self._client.server_is_ready, f"{name} is served")

    def send(self, goal: Any) -> Any:
        sent = self._client.send_goal_async(goal, feedback_callback=lambda one: self.feedback.append(one.feedback))
        return self._graph.wait(sent)

    def result(self, handle: Any) -> Any:
        return self._graph.wait(handle.get_result_async())


class Commands:
    """The joint commands of the controller with their stamps."""

    def __init__(self, graph: Graph) -> None:
        self.received: list[tuple[float, np.ndarray]] = []
        graph.client.create_subscription(JointState, "joint_command", self._on_command, 50)

    def _on_command(self, message: JointState) -> None:
        by_name = dict(zip(message.name, message.position, strict=True))
        self.received.append((to_seconds(message.header.stamp), np.array([by_name[name] for name in JOINT_NAMES])))


@pytest.fixture
def pointing(graph: Graph) -> tuple[Commands, Client]:
    """The controller on a head in simulated time, before a target at POINT_M."""
    commands = Commands(graph)
    Scene(graph, lambda time_s: np.array(POINT_M))
    return commands, Client(graph, PointHead, "gaze/point_head")


def point_goal(point_m: tuple[float, float, float] = POINT_M, **fields: Any) -> PointHead.Goal:
    goal = PointHead.Goal(**fields)
    goal.target.header.frame_id = "rig_base"
    goal.target.point.x, goal.target.point.y, goal.target.point.z = point_m
    return goal


def test_a_point_is_pointed_at_no_faster_than_asked(graph: Graph, pointing: tuple[Commands, Client]) -> None:
    commands, client = pointing
    handle = client.send(point_goal(max_velocity=0.5))
    assert handle.accepted
    assert client.result(handle).status == 4  # succeeded
    moves_rad = np.abs(np.diff([angles for _, angles in commands.received], axis=0)).max(axis=1)
    times_s = np.diff([stamp_s for stamp_s, _ in commands.received])
    assert (moves_rad <= 0.5 * times_s + 1e-6).all()
    assert client.feedback
    assert client.feedback[-1].pointing_angle_error < 0.03


@pytest.mark.parametrize(
    "goal",
    [
        point_goal((-1.0, 0.0, 0.0)),
        point_goal(pointing_frame="tilt_link"),
        point_goal(max_velocity=-1.0),
        point_goal((math.nan, 0.0, 0.0)),
    ],
    ids=["behind", "an axis that is not an eye's", "a negative speed", "no place"],
)
def test_what_cannot_be_pointed_at_is_rejected(pointing: tuple[Commands, Client], goal: PointHead.Goal) -> None:
    commands, client = pointing
    assert not client.send(goal).accepted
    assert commands.received == []


def test_a_cancelled_goal_holds(graph: Graph, pointing: tuple[Commands, Client]) -> None:
    _, client = pointing
    handle = client.send(point_goal(min_duration=Duration(sec=60)))
    graph.wait(handle.cancel_goal_async())
    assert client.result(handle).status == 5  # canceled


@pytest.fixture
def servos(graph: Graph, tmp_path: Path) -> tuple[ServoNode, Client]:
    node = graph.start(ServoNode, backend="fake", pose_file=str(tmp_path / "pose.json"), park_time_limit_s=0.0)
    return node, Client(graph, FollowJointTrajectory, "servo_node/follow_joint_trajectory")


def trajectory(*points: tuple[float, float], joint: str = "tilt") -> JointTrajectory:
    """Return a trajectory of one joint through (time [s], angle [rad])."""
    message = JointTrajectory(joint_names=[joint])
    for time_s, angle_rad in points:
        sec, nanosec = divmod(round(time_s * 1e9), 1_000_000_000)
        start = Duration(sec=sec, nanosec=nanosec)
        message.points.append(JointTrajectoryPoint(positions=[angle_rad], time_from_start=start))
    return message


def test_a_trajectory_is_followed_to_its_end(servos: tuple[ServoNode, Client]) -> None:
    node, client = servos
    handle = client.send(FollowJointTrajectory.Goal(trajectory=trajectory((0.4, 0.1), (0.8, 0.2))))
    ended = client.result(handle)
    assert (ended.status, ended.result.error_code) == (4, FollowJointTrajectory.Result.SUCCESSFUL)
    assert node._head.sent_rad()["tilt"] == pytest.approx(0.2, abs=0.02)
    assert client.feedback
    assert list(client.feedback[0].joint_names) == ["tilt"]
    desired, actual = (list(one.positions) for one in (client.feedback[-1].desired, client.feedback[-1].actual))
    assert client.feedback[-1].error.positions[0] == pytest.approx(desired[0] - actual[0])


def test_another_command_takes_its_place(graph: Graph, servos: tuple[ServoNode, Client]) -> None:
    _, client = servos
    handle = client.send(FollowJointTrajectory.Goal(trajectory=trajectory((20.0, 0.3))))
    commands = graph.client.create_publisher(JointState, "joint_command", 10)
    graph.wait_until(lambda: commands.get_subscription_count() > 0, "joint_command is subscribed")
    commands.publish(JointState(name=["tilt"], position=[0.0]))
    ended = client.result(handle)
    assert ended.status == 6  # aborted
    assert "another command" in ended.result.error_string


def test_a_newer_trajectory_takes_its_place_and_can_be_cancelled(
    graph: Graph, servos: tuple[ServoNode, Client]
) -> None:
    node, client = servos
    first = client.send(FollowJointTrajectory.Goal(trajectory=trajectory((20.0, 0.3))))
    second = client.send(FollowJointTrajectory.Goal(trajectory=trajectory((20.0, -0.3))))
    assert client.result(first).status == 6
    graph.wait(second.cancel_goal_async())
    assert client.result(second).status == 5
    graph.wait_until(lambda: node._head.trajectory is None, "the servos hold")


@pytest.mark.parametrize(
    ("message", "code"),
    [
        (trajectory((1.0, 0.1), joint="neck"), FollowJointTrajectory.Result.INVALID_JOINTS),
        (trajectory(), FollowJointTrajectory.Result.INVALID_GOAL),
        (trajectory((1.0, math.nan)), FollowJointTrajectory.Result.INVALID_GOAL),
    ],
    ids=["unknown joint", "no points", "no number"],
)
def test_a_trajectory_that_cannot_be_followed_says_why(
    servos: tuple[ServoNode, Client], message: JointTrajectory, code: int
) -> None:
    node, client = servos
    ended = client.result(client.send(FollowJointTrajectory.Goal(trajectory=message)))
    assert (ended.status, ended.result.error_code) == (6, code)
    assert "must" in ended.result.error_string
    assert node._head.trajectory is None


def test_a_tolerance_on_the_way_holds(servos: tuple[ServoNode, Client]) -> None:
    _, client = servos
    goal = FollowJointTrajectory.Goal(trajectory=trajectory((0.05, 0.5)))  # faster than any servo
    goal.path_tolerance = [JointTolerance(name="tilt", position=0.001)]
    ended = client.result(client.send(goal))
    assert ended.result.error_code == FollowJointTrajectory.Result.PATH_TOLERANCE_VIOLATED
    assert "tilt is" in ended.result.error_string
