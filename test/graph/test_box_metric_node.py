"""box_metric_node in one process with simulated eyes, and a detector of red squares with known outputs."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Header

from vergence_common.images import array_to_image, image_to_array
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_metric.boxes import DetectorError
from vergence_metric.boxes.parameters import DetectorParameters
from vergence_metric.ros.box_metric_node import BoxMetricNode
from vergence_msgs.msg import BoxVergence, DetectorClasses, ObjectRequest, StereoDetections
from vergence_rig.parameters import RenamedParameterError
from vergence_rig.rig import default_rig

pytest.importorskip("onnx", reason="the onnx package is not installed: pip install onnx")

from vergence_metric.testing.onnx_detectors import build_detector
from vergence_metric.testing.onnx_grids import FACE_POINTS

pytestmark = pytest.mark.graph

MS = 1_000_000
START_NS = 1_700_000_000_000_000_000
FOCAL_PX = 100.0
WIDTH, HEIGHT, CELL = 128, 96, 16


def scene(column: int) -> npt.NDArray[np.uint8]:
    """A red square of 16 px at a column [px], in the second row of cells."""
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    image[CELL : 2 * CELL, column : column + CELL, 2] = 255
    return image


class Eyes:
    """Publishes what two cameras and the servos would."""

    def __init__(self, graph: Any) -> None:
        self.images = [graph.client.create_publisher(Image, f"{e}/image_raw", IMAGE_QOS) for e in ("left", "right")]
        self.infos = [graph.client.create_publisher(CameraInfo, f"{e}/camera_info", 10) for e in ("left", "right")]
        self.joints = graph.client.create_publisher(JointState, "joint_states", 10)
        self.stamp_ns = START_NS
        for publisher in (*self.images, *self.infos, self.joints):
            graph.wait_until(lambda p=publisher: p.get_subscription_count() > 0, "the node subscribes")

    def show(self, left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8], step_ns: int = 100 * MS) -> int:
        """Publish a pair and return its stamp [ns]."""
        self.stamp_ns += step_ns
        stamp = from_nanoseconds(self.stamp_ns)
        self.images[0].publish(array_to_image(left, Header(stamp=stamp, frame_id="left")))
        self.images[1].publish(array_to_image(right, Header(stamp=stamp, frame_id="right")))
        return self.stamp_ns

    def describe(self) -> None:
        k = [FOCAL_PX, 0.0, (WIDTH - 1) / 2, 0.0, FOCAL_PX, (HEIGHT - 1) / 2, 0.0, 0.0, 1.0]
        for publisher in self.infos:
            publisher.publish(CameraInfo(width=WIDTH, height=HEIGHT, k=k, d=[0.0] * 5, distortion_model="plumb_bob"))

    def turn(self, stamp_ns: int, **angles: float) -> None:
        names = ("pan_left", "pan_right", "tilt")
        header = Header(stamp=from_nanoseconds(stamp_ns))
        positions = [angles.get(name, 0.0) for name in names]
        self.joints.publish(JointState(header=header, name=list(names), position=positions))


@pytest.fixture
def model(tmp_path: Path) -> str:
    return str(build_detector(tmp_path / "red.onnx", "yolov6", (WIDTH, HEIGHT), 1, names='{"0": "square"}'))


@pytest.fixture
def node(graph: Any, model: str) -> BoxMetricNode:
    node: BoxMetricNode = graph.start(BoxMetricNode, **{"detector.model": model, "detector.threshold": 0.5})
    return node


def answer(graph: Any, node: BoxMetricNode, eyes: Eyes, left: Any, right: Any) -> BoxVergence:
    stamp_ns = eyes.stamp_ns + 100 * MS
    future = graph.message(BoxVergence, "vergence/box", lambda m: to_nanoseconds(m.header.stamp) == stamp_ns)
    graph.wait_until(lambda: node._box_publisher.get_subscription_count() > 0, "our subscription is known")
    assert eyes.show(left, right) == stamp_ns
    message: BoxVergence = graph.wait(future)
    return message


def test_the_classes_are_published_to_whoever_comes_later(graph: Any, node: BoxMetricNode) -> None:
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    future = graph.message(DetectorClasses, "vergence/detector_classes", qos=latched)
    assert graph.wait(future).names == ["square", "motion"]


def test_a_face_is_looked_at_between_its_eyes(graph: Any, tmp_path: Path) -> None:
    path = build_detector(tmp_path / "yunet.onnx", "yunet", (WIDTH, HEIGHT))
    node = graph.start(BoxMetricNode, **{"detector.model": str(path)})
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    assert "face" in graph.wait(graph.message(DetectorClasses, "vergence/detector_classes", qos=latched)).names
    eyes = Eyes(graph)
    eyes.describe()
    graph.wait_until(lambda: all(node._stereo.cameras.models), "the cameras are known")
    eyes.turn(START_NS + 100 * MS)
    graph.wait_until(lambda: node._joints.known, "the joints are known")
    message = answer(graph, node, eyes, scene(64), scene(48))
    assert message.class_name == "face"
    expected = np.array(FACE_POINTS) * CELL + [63.5, 15.5]
    found = np.column_stack([message.left.landmarks_x_px, message.left.landmarks_y_px])
    np.testing.assert_allclose(found, expected, atol=1e-3)
    between = expected[:2].mean(0)
    assert (message.left.point_x_px, message.left.point_y_px) == pytest.approx(tuple(between), abs=1e-3)
    assert message.left_elevation_rad == pytest.approx(math.atan((between[1] - (HEIGHT - 1) / 2) / FOCAL_PX), abs=1e-5)
    assert message.distance_low_m < message.distance_m < message.distance_high_m


def test_a_pair_gives_metric_ii_with_the_left_stamp(graph: Any, node: BoxMetricNode) -> None:
    message = answer(graph, node, Eyes(graph), scene(64), scene(48))
    assert message.status == BoxVergence.STATUS_OK
    assert message.header.frame_id == "left"
    assert message.class_name == "square"
    assert (message.left.x_min_px, message.left.y_max_px) == (63.5, 31.5)
    assert message.left_minus_right_top_left_x_px == 16.0
    assert message.right_minus_left_bottom_right_x_px == -16.0
    assert message.left_minus_right_top_left_y_px == 0.0
    assert message.center_horizontal_px == 16.0
    assert message.size_ratio == 1.0
    focal_px = default_rig().left_camera.fx_px * WIDTH / 640  # no camera_info: the rig's description is used
    assert message.center_horizontal_rad == pytest.approx(16.0 / focal_px, rel=0.05)


def test_with_cameras_and_joints_it_is_placed_in_space(graph: Any, node: BoxMetricNode) -> None:
    eyes = Eyes(graph)
    eyes.describe()
    graph.wait_until(lambda: all(node._stereo.cameras.models), "the cameras are known")
    eyes.turn(START_NS + 100 * MS)
    graph.wait_until(lambda: node._joints.known, "the joints are known")
    future = graph.message(PoseWithCovarianceStamped, "vergence/target_point")
    graph.wait_until(lambda: node._point_publisher.get_subscription_count() > 0, "our subscription is known")
    message = answer(graph, node, eyes, scene(64), scene(48))
    assert message.left_azimuth_rad == pytest.approx(math.atan(0.08))
    assert message.center_horizontal_rad == pytest.approx(2 * math.atan(0.08))
    point: PoseWithCovarianceStamped = graph.wait(future)
    assert point.header.frame_id == "rig_base"
    assert point.header.stamp == message.header.stamp
    # 16 px at a focal length of 100 px and a baseline of 65 mm.
    assert point.pose.pose.position.x == pytest.approx(0.065 * 100 / 16)
    assert point.pose.covariance[0] > 0.0
    assert point.pose.pose.orientation.w == 1.0


def test_one_eye_blind_is_said_and_not_zero(graph: Any, node: BoxMetricNode) -> None:
    message = answer(graph, node, Eyes(graph), scene(64), np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    assert message.status == BoxVergence.STATUS_LEFT_ONLY
    assert message.reason
    assert math.isnan(message.center_horizontal_px)
    assert math.isnan(message.sigma_px)
    assert math.isnan(message.right.x_min_px)
    assert message.left.x_min_px == 63.5


def test_two_that_cross_keep_their_ids_and_the_requested_one_is_the_target(graph: Any, node: BoxMetricNode) -> None:
    eyes = Eyes(graph)
    graph.set_parameters(node, **{"motion.enable": False})

    def both(first: int, second: int) -> BoxVergence:
        """A darker square in the upper row and a brighter one below, which move past one another."""
        views = [np.zeros((HEIGHT, WIDTH, 3), np.uint8) for _ in range(2)]
        for view, shift in zip(views, (0, CELL), strict=True):
            view[CELL : 2 * CELL, first - shift : first - shift + CELL, 2] = 200
            view[3 * CELL : 4 * CELL, second - shift : second - shift + CELL, 2] = 255
        return answer(graph, node, eyes, *views)

    message = both(32, 80)
    rows = {one.object_id: one for one in message.objects}
    assert len(rows) == 2
    target = message.object_id
    (other,) = set(rows) - {target}
    assert "of 2 objects" in message.choice_reason
    for first in (48, 64, 80):
        message = both(first, 112 - first)
        assert message.object_id == target
        assert {one.object_id for one in message.objects} == {target, other}
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    requests = graph.client.create_publisher(ObjectRequest, "vergence/object_request", latched)
    requests.publish(ObjectRequest(class_name="square", object_id=other))
    graph.wait_until(lambda: node._measurement._choice._requested.object_id == other, "the request has arrived")
    before_px = message.left.y_min_px
    message = both(80, 32)
    assert message.object_id == other
    assert message.left.y_min_px != before_px
    assert message.choice_reason == f"object {other} is requested"


def test_detections_and_picture_are_published_while_subscribed(graph: Any, node: BoxMetricNode) -> None:
    eyes = Eyes(graph)
    assert node._overlay_publisher.get_subscription_count() == 0
    answer(graph, node, eyes, scene(64), scene(48))
    assert "overlay_median_ms" not in node._times.summary()
    picture = graph.message(Image, "vergence/box_overlay", qos=IMAGE_QOS)
    seen = graph.message(StereoDetections, "vergence/detections")
    for publisher in (node._overlay_publisher, node._detections_publisher):
        graph.wait_until(lambda p=publisher: p.get_subscription_count() > 0, "our subscriptions are known")
    left, right = np.maximum(scene(64), scene(0)), scene(48)
    answer(graph, node, eyes, left, right)
    assert image_to_array(graph.wait(picture)).shape == (HEIGHT, 2 * WIDTH, 3)
    detections: StereoDetections = graph.wait(seen)
    assert sorted(box.x_min_px for box in detections.left) == [-0.5, 63.5]
    assert [box.class_name for box in detections.right] == ["square"]


def test_pairs_beyond_its_rate_are_left_out(graph: Any, node: BoxMetricNode) -> None:
    eyes = Eyes(graph)
    stamps: list[int] = []
    graph.client.create_subscription(
        BoxVergence, "vergence/box", lambda m: stamps.append(to_nanoseconds(m.header.stamp)), 10
    )
    graph.wait_until(lambda: node._box_publisher.get_subscription_count() > 0, "our subscription is known")
    graph.set_parameters(node, rate_hz=10.0)
    shown = []
    for _ in range(7):
        shown.append(eyes.show(scene(64), scene(48), step_ns=50 * MS))
        before = len(stamps)
        if len(shown) % 2:
            graph.wait_until(lambda n=before: len(stamps) > n, "every second pair is measured")
    assert stamps == shown[::2]


def test_it_can_be_switched_off_and_on(graph: Any, node: BoxMetricNode) -> None:
    eyes = Eyes(graph)
    assert graph.set_parameters(node, enable=False).successful
    answered = node._worker.worked
    eyes.show(scene(64), scene(48))
    graph.diagnostic("detector", lambda status: status.message == "not enabled")
    assert node._worker.worked == answered
    assert graph.set_parameters(node, enable=True).successful
    assert answer(graph, node, eyes, scene(64), scene(48)).status == BoxVergence.STATUS_OK


def test_parameters_that_cannot_be_are_refused_and_nothing_changes(graph: Any, node: BoxMetricNode) -> None:
    refused = graph.set_parameters(node, **{"detector.classes": ["cube"], "detector.threshold": 0.9})
    assert not refused.successful
    assert "class must be one of the model's (square): got 'cube'" in refused.reason
    assert node._settings.get(DetectorParameters).threshold == 0.5
    assert graph.set_parameters(node, **{"detector.classes": ["square"]}).successful
    assert not graph.set_parameters(node, **{"detector.threshold": 1.5}).successful


def test_a_model_that_is_not_there_ends_the_node_with_one_line(graph: Any) -> None:
    with pytest.raises(DetectorError, match=r"model /nowhere/gone\.onnx: no such file"):
        BoxMetricNode(context=graph.context, parameter_overrides=_overrides(**{"detector.model": "/nowhere/gone.onnx"}))


@pytest.mark.parametrize(
    ("former", "value", "present"),
    [
        ("iou", 0.5, r"detector\.iou_threshold"),
        ("pair_vertical_px", 5.0, r"association\.max_vertical_px' \(in px\)"),
        ("forget_s", 2.0, r"follow\.forget_after_s' \(in s\)"),
        ("model", "", r"detector\.model"),
    ],
)
def test_a_former_name_ends_the_node_with_the_present_one(graph: Any, former: str, value: Any, present: str) -> None:
    with pytest.raises(RenamedParameterError, match=f"'{former}' was renamed: set '{present}"):
        BoxMetricNode(context=graph.context, parameter_overrides=_overrides(**{former: value}))


def _overrides(**values: Any) -> list[Any]:
    from rclpy.parameter import Parameter

    return [Parameter(name, value=value) for name, value in values.items()]
