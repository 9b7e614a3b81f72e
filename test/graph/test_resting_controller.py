"""gaze_controller_node without a goal: it reads nothing that costs the metric nodes work, and little of its own."""

from collections.abc import Callable
from typing import Any

import pytest
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from vergence_gaze.ros import vision_input
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_msgs.action import LookAt
from vergence_msgs.msg import GazeState
from vergence_rig.rig import JOINT_NAMES

pytestmark = pytest.mark.graph

MEASURED = ("vergence/track", "vergence/box", "vergence/eye_rotation")


@pytest.fixture
def node(graph: Any, monkeypatch: pytest.MonkeyPatch) -> GazeControllerNode:
    """The controller of a head whose joints are reported."""
    monkeypatch.setattr(vision_input, "_UNUSED_S", 0.0)
    node: GazeControllerNode = graph.start(GazeControllerNode)
    publisher = graph.client.create_publisher(JointState, "joint_states", 10)

    def report() -> None:
        header = Header(stamp=graph.client.get_clock().now().to_msg())
        publisher.publish(JointState(header=header, name=list(JOINT_NAMES), position=[0.0, 0.1, 0.0]))

    graph.client.create_timer(0.02, report)
    graph.wait_until(
        lambda: node._newest is not None and node._newest.report.vergence_rad == pytest.approx(0.1), "joints"
    )
    return node


def read(node: GazeControllerNode) -> Callable[[], bool]:
    return lambda: all(node.count_subscribers(topic) for topic in MEASURED)


def test_measurements_are_subscribed_while_a_goal_needs_them(graph: Any, node: GazeControllerNode) -> None:
    graph.wait_until(lambda: not any(node.count_subscribers(topic) for topic in MEASURED), "nothing is read")
    assert not node._newest.report.images_missing  # type: ignore[union-attr]
    client = ActionClient(graph.client, LookAt, "gaze/look_at")
    graph.wait_until(client.server_is_ready, "the action")
    goal = LookAt.Goal(kind=LookAt.Goal.PIXEL, left_x_px=320.0, left_y_px=240.0, time_limit_s=60.0)
    handle = graph.wait(client.send_goal_async(goal))
    graph.wait_until(read(node), "everything is read")
    graph.wait(handle.cancel_goal_async())
    graph.wait_until(lambda: not any(node.count_subscribers(topic) for topic in MEASURED), "nothing is read again")


def test_cycles_are_rare_until_something_reads_the_state(graph: Any, node: GazeControllerNode) -> None:
    graph.wait_until(lambda: node._cycle_timer.timer.timer_period_ns == 100_000_000, "the controller rests")
    state = graph.message(GazeState, "gaze/state")
    graph.wait_until(lambda: node._cycle_timer.timer.timer_period_ns == 20_000_000, "the full rate")
    assert graph.wait(state).phase_name == "idle"
