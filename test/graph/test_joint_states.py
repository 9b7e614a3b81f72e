"""joint_states as every node reads them: what is refused is named, and joints of two messages are put together."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from sensor_msgs.msg import JointState

from vergence_common.stamps import from_nanoseconds
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_metric.ros.box_metric_node import BoxMetricNode
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_metric.ros.eye_rotation_node import EyeRotationNode
from vergence_msgs.msg import GazeState
from vergence_rig.rig import JOINT_NAMES

pytestmark = pytest.mark.graph

READERS = (EdgeMetricNode, EyeRotationNode, BoxMetricNode, GazeControllerNode)
S = 1_000_000_000


class Servos:
    """A driver of servos on the test's graph: publishes joint_states, stamped now and `off_s` later."""

    def __init__(self, graph: Any) -> None:
        self._client = graph.client
        self._publisher = graph.client.create_publisher(JointState, "joint_states", 10)
        graph.wait_until(lambda: self._publisher.get_subscription_count() > 0, "the node subscribes")

    def publish(
        self, names: Any = JOINT_NAMES, positions: Any = (0.0, 0.05, 0.0), off_s: float | None = 0.0, **fields: Any
    ) -> None:
        message = JointState(name=list(names), position=list(positions), **fields)
        if off_s is not None:
            now_ns = self._client.get_clock().now().nanoseconds
            message.header.stamp = from_nanoseconds(now_ns + round(off_s * S))
        self._publisher.publish(message)


@pytest.mark.parametrize("kind", READERS, ids=lambda kind: kind.__name__)
def test_what_is_refused_is_named_in_the_diagnostics(graph: Any, kind: Callable[..., Node]) -> None:
    if kind is BoxMetricNode:
        pytest.importorskip("onnxruntime")
    node = graph.start(kind)
    status = graph.diagnostic(": joint_states", lambda s: s.level == DiagnosticStatus.WARN)
    assert status.message == "no joint_states have arrived: what depends on the joints is NaN"
    servos = Servos(graph)
    cases: list[tuple[dict[str, Any], str]] = [
        ({"names": ("elbow", "wrist"), "positions": (0.0, 0.0)}, "got elbow, wrist"),
        ({"positions": (), "velocity": [0.1, 0.2, 0.3]}, "velocities or efforts alone"),
        ({"positions": (0.1, 0.2)}, "got 2 for 3 names"),
        ({"positions": (0.1, math.nan, 0.2)}, "pan_right must be a finite angle"),
        ({"off_s": None}, "it is zero"),
        ({"off_s": 5.0}, "ahead of the clock"),
    ]
    for fields, text in cases:
        servos.publish(**fields)
        status = graph.diagnostic(": joint_states", lambda s, text=text: text in s.message)
        assert status.level != DiagnosticStatus.OK
    servos.publish()
    graph.diagnostic(": joint_states", lambda s: "some joint_states are refused" in s.message)
    assert node._joint_input.reader.refused.total() == len(cases)


def test_the_controllers_reason_says_why_no_joint_is_known(graph: Any) -> None:
    graph.start(GazeControllerNode)
    servos, states = Servos(graph), list[GazeState]()
    graph.client.create_subscription(GazeState, "gaze/state", states.append, 10)

    def has_reason(text: str) -> None:
        graph.wait_until(lambda: bool(states) and text in states[-1].reason, text)
        assert math.isnan(states[-1].tilt_rad)

    has_reason("waiting: no joint_states have arrived")
    servos.publish(positions=(), velocity=[0.0] * 3)
    has_reason("velocities or efforts alone")
    servos.publish(names=("elbow",), positions=(0.0,))
    has_reason("got elbow")
    status = graph.diagnostic(": gaze", lambda s: "got elbow" in s.message)
    assert status.level != DiagnosticStatus.OK


@pytest.mark.parametrize("kind", [EdgeMetricNode, GazeControllerNode], ids=lambda kind: kind.__name__)
def test_joints_of_two_messages_are_put_together(graph: Any, kind: Callable[..., Node]) -> None:
    graph.start(kind)
    servos = Servos(graph)
    servos.publish(names=JOINT_NAMES[:2], positions=(0.1, 0.2))
    graph.diagnostic(": joint_states", lambda s: "joint_states lack tilt" in s.message)
    servos.publish(names=JOINT_NAMES[2:], positions=(-0.1,))
    graph.diagnostic(": joint_states", lambda s: s.level == DiagnosticStatus.OK)
    if kind is GazeControllerNode:
        state = graph.wait(graph.message(GazeState, "gaze/state", lambda m: math.isfinite(m.tilt_rad)))
        assert (state.vergence_rad, state.tilt_rad) == pytest.approx((0.1, -0.1))
