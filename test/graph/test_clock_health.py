"""Without /clock every node says so in its diagnostics, by a clock that does not stand still."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from vergence_bringup.node_table import NODES
from vergence_camera.ros.camera_node import CameraNode
from vergence_camera.testing.fake_machine import FakeMachine
from vergence_common import clock_health
from vergence_common.stamps import to_stamp
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_metric.ros.box_metric_node import BoxMetricNode
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_metric.ros.eye_rotation_node import EyeRotationNode
from vergence_servo.ros.servo_node import ServoNode
from vergence_web.ros.web_node import WebNode

pytestmark = pytest.mark.graph

OF_THE_CLOCK = {"sim_node", "photo_node"}
"""They publish /clock themselves."""


def _camera(tmp_path: Path) -> tuple[Callable[..., Node], dict[str, Any]]:
    machine = FakeMachine(tmp_path / "machine")
    machine.plug_in(0)
    return partial(CameraNode, kernel=machine.kernel, tree=machine.tree), {"device": "0"}


def _box(tmp_path: Path) -> tuple[Callable[..., Node], dict[str, Any]]:
    pytest.importorskip("onnxruntime", reason="the shipped detector needs onnxruntime")
    return BoxMetricNode, {}


def _plain(
    kind: Callable[..., Node], **parameters: Any
) -> Callable[[Path], tuple[Callable[..., Node], dict[str, Any]]]:
    return lambda tmp_path: (kind, parameters)


MADE: dict[str, Callable[[Path], tuple[Callable[..., Node], dict[str, Any]]]] = {
    "box_metric_node": _box,
    "camera_node": _camera,
    "edge_metric_node": _plain(EdgeMetricNode),
    "eye_rotation_node": _plain(EyeRotationNode),
    "gaze_controller_node": _plain(GazeControllerNode),
    "servo_node": _plain(ServoNode, backend="fake", guardian=False),
    "web_node": _plain(WebNode, port=0),
}


def test_every_node_that_follows_a_clock_is_tried_here() -> None:
    assert set(MADE) == set(NODES) - OF_THE_CLOCK


@pytest.mark.parametrize("executable", sorted(MADE))
def test_no_clock_is_an_error_of_every_node(
    executable: str, graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    kind, parameters = MADE[executable](tmp_path)
    graph.start(kind, use_sim_time=True, **parameters)
    status = graph.diagnostic(f"{executable}: clock", lambda s: True)
    assert status.level == DiagnosticStatus.ERROR
    assert status.message.startswith("no /clock arrives (nothing publishes it), and use_sim_time is true: ")


def test_a_clock_that_stops_and_goes_on(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clock_health, "STANDS_AFTER_S", 0.3)
    publisher = graph.client.create_publisher(Clock, "/clock", 10)
    graph.start(EdgeMetricNode, use_sim_time=True)
    times = iter(range(5, 10**9))
    timer = graph.client.create_timer(0.01, lambda: publisher.publish(Clock(clock=to_stamp(next(times)))))
    graph.diagnostic(": clock", lambda s: s.level == DiagnosticStatus.OK)
    timer.cancel()
    status = graph.diagnostic(": clock", lambda s: s.level == DiagnosticStatus.WARN)
    assert status.message.startswith("no /clock arrives: simulated time has stood for ")
    timer.reset()
    graph.diagnostic(": clock", lambda s: s.level == DiagnosticStatus.OK)


def test_a_node_on_the_systems_clock_says_nothing_of_it(graph: Any) -> None:
    graph.start(EdgeMetricNode)
    message = graph.wait(graph.message(DiagnosticArray, "/diagnostics"))
    assert message.status
    assert not [status.name for status in message.status if status.name.endswith(": clock")]
