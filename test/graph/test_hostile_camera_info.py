"""A camera_info beyond reason ends no node; the diagnostics name the camera and what must hold."""

from typing import Any

import pytest
from sensor_msgs.msg import CameraInfo

from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_metric.ros.box_metric_node import BoxMetricNode
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_metric.ros.eye_rotation_node import EyeRotationNode

pytestmark = pytest.mark.graph

PLAIN = [0.0] * 5
HOSTILE = [
    (539.0, [1e308, 0.0, 0.0, 0.0, 0.0]),
    (539.0, [0.0, 0.0, 0.0, 0.0, 1e-310]),
    (539.0, [-1.0, 0.0, 0.0, 0.0, 0.0]),
    (539.0, [1000.0, 0.0, 0.0, 0.0, 0.0]),
    (1.0, PLAIN),
    (1e-300, PLAIN),
    (1e300, PLAIN),
    (float("nan"), PLAIN),
    (539.0, PLAIN[:3]),
]


def _info(focal: float, d: list[float]) -> CameraInfo:
    k = [focal, 0.0, 319.5, 0.0, focal, 239.5, 0.0, 0.0, 1.0]
    return CameraInfo(width=640, height=480, k=k, d=d, distortion_model="plumb_bob")


@pytest.mark.parametrize("kind", [EdgeMetricNode, BoxMetricNode, EyeRotationNode])
def test_a_metric_node_names_the_camera_and_goes_on(graph: Any, kind: Any) -> None:
    node = graph.start(kind)
    publisher = graph.client.create_publisher(CameraInfo, "right/camera_info", 10)
    graph.wait_until(publisher.get_subscription_count, "the node to subscribe")
    for focal, d in HOSTILE:
        node._stereo.cameras._info_errors[1] = None
        publisher.publish(_info(focal, d))
        status = graph.diagnostic("cameras", lambda status: status.message.startswith("right/camera_info: "))
        assert " must be " in status.message
    publisher.publish(_info(539.0, PLAIN))
    graph.wait_until(lambda: node._stereo.cameras.models[1] is not None, "a calibration to be taken")


def test_the_controller_keeps_its_cameras(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = graph.start(GazeControllerNode)
    before, received, receive = node._cameras[0], list[list[float]](), node._on_camera

    def on_camera(message: CameraInfo, left: bool) -> None:
        receive(message, left)
        received.append(list(message.d))

    monkeypatch.setattr(node, "_on_camera", on_camera)
    publisher = graph.client.create_publisher(CameraInfo, "left/camera_info", 10)
    graph.wait_until(publisher.get_subscription_count, "the node to subscribe")
    for focal, d in HOSTILE:
        publisher.publish(_info(focal, d))
        graph.wait_until(lambda d=d: received[-1:] == [d], "the message")
        assert node._cameras[0].equals(before)
    publisher.publish(_info(400.0, PLAIN))
    graph.wait_until(lambda: not node._cameras[0].equals(before), "a calibration to be taken")
