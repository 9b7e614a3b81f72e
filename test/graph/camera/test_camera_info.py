"""The calibration that a camera node publishes, blanks and saves."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import CameraInfo
from sensor_msgs.srv import SetCameraInfo

from vergence_camera.camera_info import Calibration, load_calibration, save_calibration
from vergence_camera.ros.camera_node import CameraNode
from vergence_camera.testing.fake_machine import FakeMachine

pytestmark = pytest.mark.graph

K = (533.0, 0.0, 339.0, 0.0, 534.0, 234.0, 0.0, 0.0, 1.0)


def test_a_calibration_is_published_from_its_url(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], tmp_path: Path, info_of: Any
) -> None:
    camera = machine.plug_in(0)
    path = tmp_path / "left.yaml"
    save_calibration(Calibration(640, 480, K, (-0.3, 0.1, 0.0, 0.0, 0.0)), path)
    start(camera_info_url=path.as_uri())
    info = info_of(graph, camera)
    assert tuple(info.k) == K
    assert (info.width, info.height, info.distortion_model, list(info.d)[:2]) == (640, 480, "plumb_bob", [-0.3, 0.1])
    assert info.header.frame_id == "left_camera_optical_frame"
    graph.diagnostic("calibration", lambda s: s.level == DiagnosticStatus.OK)


def test_a_calibration_for_another_size_is_blanked_with_a_warning(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], tmp_path: Path, info_of: Any
) -> None:
    camera = machine.plug_in(0)
    path = tmp_path / "left.yaml"
    save_calibration(Calibration(1280, 720, K, (0.0,) * 5), path)
    start(camera_info_url=path.as_uri())
    info = info_of(graph, camera)
    assert (info.width, info.height) == (640, 480)
    assert not any(info.k)
    status = graph.diagnostic("calibration", lambda s: s.level == DiagnosticStatus.WARN)
    assert "1280x720" in status.message
    assert "640x480" in status.message


def test_set_camera_info_saves_and_publishes(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], ros_home: Path, info_of: Any
) -> None:
    camera = machine.plug_in(0)
    start()
    client = graph.client.create_client(SetCameraInfo, "/left/set_camera_info")
    graph.wait_until(client.service_is_ready, "the service")
    assert not any(info_of(graph, camera).k)
    wanted = CameraInfo(width=640, height=480, k=K, d=[0.1] * 5, distortion_model="plumb_bob")
    answer = graph.wait(client.call_async(SetCameraInfo.Request(camera_info=wanted)))
    assert answer.success, answer.status_message
    saved = load_calibration(ros_home / "camera_info" / "left.yaml")
    assert (saved.k, saved.name) == (K, "left")
    assert tuple(info_of(graph, camera).k) == K
    wrong = CameraInfo(width=320, height=240, k=K, d=[0.1] * 5, distortion_model="plumb_bob")
    answer = graph.wait(client.call_async(SetCameraInfo.Request(camera_info=wrong)))
    assert not answer.success
    assert "640x480" in answer.status_message
    assert load_calibration(ros_home / "camera_info" / "left.yaml") == saved


@pytest.mark.parametrize("value", [1e308, 1e-310, 1000.0, -1.0])
def test_set_camera_info_refuses_numbers_that_no_lens_has(
    graph: Any, machine: FakeMachine, start: Callable[..., CameraNode], ros_home: Path, value: float
) -> None:
    machine.plug_in(0)
    start()
    client = graph.client.create_client(SetCameraInfo, "/left/set_camera_info")
    graph.wait_until(client.service_is_ready, "the service")
    hostile = CameraInfo(width=640, height=480, k=K, d=[value, 0.0, 0.0, 0.0, 0.0], distortion_model="plumb_bob")
    answer = graph.wait(client.call_async(SetCameraInfo.Request(camera_info=hostile)))
    assert not answer.success
    assert answer.status_message.startswith("left: distortion must be")
    assert not list(ros_home.rglob("*.yaml"))
