"""edge_metric_node in one process with the eyes of the test: what comes out for what goes in, good and bad."""

import math
import threading
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import Header

from vergence_common.images import array_to_compressed, array_to_image
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_metric.measurement.edge_metric import EdgeMetric
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_msgs.msg import EdgeVergence, TargetTrack, TrackRequest, VergenceError
from vergence_rig.rig import default_rig

pytestmark = pytest.mark.graph

Pixels = npt.NDArray[np.uint8]
MS = 1_000_000
START_NS = 1_700_000_000_000_000_000
FOCAL_PX = 500.0


def view(shift_px: int, width: int = 320, height: int = 240) -> Pixels:
    """A wall of rectangles (height, width, 3) BGR, seen `shift_px` further to the left."""
    random = np.random.default_rng(3)
    wide = np.full((height, width + 100, 3), 120, np.uint8)
    for _ in range(150):
        x, y, w, h = (int(v) for v in random.integers((0, 0, 8, 8), (width + 100, height, 50, 50)))
        cv2.rectangle(wide, (x, y), (x + w, y + h), tuple(int(v) for v in random.integers(0, 256, 3)), -1)
    wide = cv2.GaussianBlur(wide, (0, 0), 0.8)
    return np.ascontiguousarray(wide[:, 40 + shift_px : 40 + shift_px + width])


class Eyes:
    """Publishes what two cameras would; every pair is 33 ms after the last."""

    def __init__(self, graph: Any, compressed: bool = False) -> None:
        self._graph = graph
        self._compressed = compressed
        kind, suffix = (CompressedImage, "image_raw/compressed") if compressed else (Image, "image_raw")
        node = graph.client
        self.images = [node.create_publisher(kind, f"{eye}/{suffix}", IMAGE_QOS) for eye in ("left", "right")]
        self.infos = [node.create_publisher(CameraInfo, f"{eye}/camera_info", 10) for eye in ("left", "right")]
        self.joints = node.create_publisher(JointState, "joint_states", 10)
        self.stamp_ns = START_NS
        for publisher in (*self.images, *self.infos, self.joints):
            graph.wait_until(lambda p=publisher: p.get_subscription_count() > 0, "the node subscribes")

    def image(self, side: int, pixels: Pixels, skew_ns: int = 0) -> Any:
        header = Header(stamp=from_nanoseconds(self.stamp_ns + skew_ns), frame_id=("left", "right")[side])
        return array_to_compressed(pixels, header, 95) if self._compressed else array_to_image(pixels, header)

    def show(self, left: Pixels, right: Pixels, skew_ns: int = 0) -> int:
        """Publish a pair and return its stamp [ns]."""
        self.stamp_ns += 33 * MS
        self.images[0].publish(self.image(0, left))
        self.images[1].publish(self.image(1, right, skew_ns))
        return self.stamp_ns

    def describe(self, width: int = 320, height: int = 240) -> None:
        for publisher in self.infos:
            k = [FOCAL_PX, 0.0, (width - 1) / 2, 0.0, FOCAL_PX, (height - 1) / 2, 0.0, 0.0, 1.0]
            publisher.publish(CameraInfo(width=width, height=height, k=k, d=[0.0] * 5, distortion_model="plumb_bob"))


def at(stamp_ns: int) -> Any:
    return lambda message: to_nanoseconds(message.header.stamp) == stamp_ns


def answers(graph: Any, eyes: Eyes, left: Pixels, right: Pixels, skew_ns: int = 0) -> tuple[Any, Any, Any]:
    """Show a pair and return its edge, error and track message."""
    stamp_ns = eyes.stamp_ns + 33 * MS
    kinds = ((EdgeVergence, "vergence/edge"), (VergenceError, "vergence/error"), (TargetTrack, "vergence/track"))
    futures = [graph.message(kind, topic, at(stamp_ns)) for kind, topic in kinds]
    for _, topic in kinds:
        graph.wait_until(lambda t=topic: graph.client.count_publishers(t) > 0, f"{topic} is published")
    graph.wait_until(lambda: graph.node_matched(), "our subscriptions are known to the node")
    eyes.show(left, right, skew_ns)
    edge, error, track = (graph.wait(future) for future in futures)
    return edge, error, track


@pytest.fixture
def node(graph: Any) -> EdgeMetricNode:
    node: EdgeMetricNode = graph.start(EdgeMetricNode)
    graph.node_matched = lambda: node._track_publisher.get_subscription_count() > 0
    graph.client.create_subscription(TargetTrack, "vergence/track", lambda _: None, 10)
    graph.wait_until(graph.node_matched, "the track is read: without readers nothing is measured")
    return node


@pytest.fixture
def eyes(graph: Any, node: EdgeMetricNode) -> Eyes:
    return Eyes(graph)


def values(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


def has(status: DiagnosticStatus, text: str) -> bool:
    return text in status.message


def test_a_pair_gives_the_pure_metric_and_the_shift_with_the_left_stamp(graph: Any, eyes: Eyes) -> None:
    left, right = view(0), view(7)
    edge, error, track = answers(graph, eyes, left, right, skew_ns=3 * MS)
    pure = EdgeMetric().measure(left, right)
    assert edge.windows_px.tolist() == [50, 100, 150, 200, 250, 300]
    np.testing.assert_array_equal(edge.left_to_right_px, pure.left_to_right_px)
    np.testing.assert_array_equal(edge.right_to_left_px, pure.right_to_left_px)
    np.testing.assert_array_equal(edge.status, pure.status)
    assert min(edge.left_edge_count) > 0
    assert error.horizontal_px == pytest.approx(7.0, abs=0.05)
    assert error.vertical_px == pytest.approx(0.0, abs=0.05)
    assert error.confidence > 0.5
    for message in (edge, error, track):
        assert to_nanoseconds(message.header.stamp) == eyes.stamp_ns
        assert message.header.frame_id == "left"
        assert message.pair_skew_s == pytest.approx(0.003)


def test_angles_are_nan_where_nothing_describes_the_cameras(graph: Any, eyes: Eyes) -> None:
    _, error, track = answers(graph, eyes, view(0, 320, 200), view(7, 320, 200))
    assert error.status == VergenceError.STATUS_NO_CAMERA_INFO
    assert math.isnan(error.horizontal_rad)
    assert math.isnan(error.vertical_rad)
    assert math.isnan(track.disparity_rad)
    assert "camera_info" in error.reason
    status = graph.diagnostic("cameras", lambda s: s.level == DiagnosticStatus.ERROR)
    assert has(status, "rig.yaml describes another image shape too")


def test_without_calibration_the_rigs_description_is_used(graph: Any, eyes: Eyes) -> None:
    left, right = view(0), view(7)
    _, error, _ = answers(graph, eyes, left, right)
    assert error.status == VergenceError.STATUS_OK
    focal_px = 0.5 * default_rig().left_camera.fx_px  # the rig's images are twice as large
    assert error.horizontal_rad == pytest.approx(math.atan(7 / focal_px), abs=0.1 / focal_px)
    status = graph.diagnostic("cameras", lambda s: s.level == DiagnosticStatus.WARN)
    assert status.message == "left/camera_info: no message yet; rig.yaml's description of the camera is used"
    eyes.describe()
    status = graph.diagnostic("cameras", lambda s: s.level == DiagnosticStatus.OK)
    assert has(status, "both cameras")
    _, error, _ = answers(graph, eyes, left, right)
    assert error.status == VergenceError.STATUS_OK
    # the point is the left image's centre: straight ahead in the left eye, 7 px to the left of it in the right one
    assert error.horizontal_rad == pytest.approx(math.atan(7 / FOCAL_PX), abs=0.1 / FOCAL_PX)
    assert error.vertical_rad == pytest.approx(0.0, abs=0.1 / FOCAL_PX)


def test_camera_info_of_another_size_is_named_and_not_used(graph: Any, eyes: Eyes) -> None:
    eyes.describe(640, 480)
    _, error, _ = answers(graph, eyes, view(0), view(7))
    assert error.status == VergenceError.STATUS_OK
    status = graph.diagnostic("cameras", lambda s: s.level == DiagnosticStatus.ERROR)
    assert has(status, "left/camera_info: must be for 320x240 images: got 640x480; rig.yaml's description")


def test_an_image_without_edges_gives_nan_and_a_status(graph: Any, eyes: Eyes) -> None:
    blank = np.full((240, 320, 3), 90, np.uint8)
    edge, error, track = answers(graph, eyes, blank, blank)
    assert np.isnan(edge.left_to_right_px).all()
    assert set(edge.status) == {EdgeVergence.STATUS_NO_EDGES}
    assert error.status == VergenceError.STATUS_NO_TEXTURE
    assert math.isnan(error.horizontal_px)
    assert track.status != TargetTrack.STATUS_OK


def test_joint_states_that_do_not_reach_the_image_leave_the_track_unlocked(graph: Any, eyes: Eyes) -> None:
    names, angles = ["pan_left", "pan_right", "tilt"], [0.0, 0.0, 0.0]
    eyes.describe()
    eyes.joints.publish(
        JointState(header=Header(stamp=from_nanoseconds(START_NS - 10**10)), name=names, position=angles)
    )
    graph.diagnostic("cameras", lambda s: s.level == DiagnosticStatus.OK)
    _, _, track = answers(graph, eyes, view(0), view(7))
    assert track.status == TargetTrack.STATUS_UNLOCKED
    assert track.reason == "no joint_states at the image's stamp: the newest is 10.03 s older"


def broken(message: Image, **changes: Any) -> Image:
    for name, value in changes.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"encoding": "32FC1"}, "got '32FC1'"),
        ({"height": 241}, "data must have 231360 bytes (241 rows of 960): got 230400"),
        ({"step": 100}, "got 100"),
        ({"width": 0}, "size must be at least 1x1: got 0x240"),
    ],
)
def test_a_wrong_image_is_named_counted_and_survived(
    graph: Any, eyes: Eyes, changes: dict[str, Any], complaint: str
) -> None:
    eyes.images[0].publish(broken(eyes.image(0, view(0)), **changes))
    status = graph.diagnostic("left images", lambda s: "refused" in values(s) and values(s)["refused"] == "1")
    assert status.level == DiagnosticStatus.ERROR
    assert status.message.startswith("left/image_raw: ")
    assert complaint in status.message
    edge, _, _ = answers(graph, eyes, view(0), view(7))
    assert edge.status[0] == EdgeVergence.STATUS_OK


def test_images_of_different_size_are_named_and_survived(graph: Any, eyes: Eyes) -> None:
    eyes.show(view(0), view(0, 160, 100))
    status = graph.diagnostic("pairs", lambda s: s.level == DiagnosticStatus.ERROR)
    assert has(status, "cameras without calibration must have one size: got 320x240 and 160x100")
    assert values(status)["size_mismatches"] == "1"
    answers(graph, eyes, view(0), view(7))


def test_cameras_of_two_sizes_are_measured_as_one(graph: Any, eyes: Eyes) -> None:
    small = cv2.resize(view(7), (160, 120), interpolation=cv2.INTER_AREA)
    _, error, _ = answers(graph, eyes, view(0), small)
    assert error.status == VergenceError.STATUS_OK
    focal_px = 0.5 * default_rig().left_camera.fx_px
    assert error.horizontal_rad == pytest.approx(math.atan(7 / focal_px), abs=0.5 / focal_px)


def test_no_right_camera_is_named(graph: Any) -> None:
    graph.start(EdgeMetricNode, stalled_after_s=0.2)
    left = graph.client.create_publisher(Image, "left/image_raw", IMAGE_QOS)
    graph.wait_until(lambda: left.get_subscription_count() > 0, "the node subscribes")
    left.publish(array_to_image(view(0), Header(stamp=from_nanoseconds(START_NS))))
    status = graph.diagnostic("right images", lambda s: s.level == DiagnosticStatus.ERROR)
    assert status.message.startswith("right/image_raw: no image since the start, ")
    assert status.message.endswith(" s (the topic has no publisher)")


def test_a_stalled_stream_is_named(graph: Any) -> None:
    graph.start(EdgeMetricNode, stalled_after_s=0.2)
    Eyes(graph).show(view(0), view(7))
    status = graph.diagnostic("right images", lambda s: values(s).get("received") == "1" and has(s, "no image"))
    assert status.level == DiagnosticStatus.ERROR
    assert status.message.startswith("right/image_raw: no image for ")
    assert "publisher" not in status.message


def test_stamps_that_never_meet_are_named_with_their_skew(graph: Any, node: EdgeMetricNode, eyes: Eyes) -> None:
    received = node._stereo._pairer.statistics.received
    for shown in range(1, 13):
        eyes.stamp_ns += 67 * MS  # with the 33 ms of `show`: 100 ms apart, right 40 ms behind
        eyes.show(view(0), view(7), skew_ns=40 * MS)
        graph.wait_until(lambda n=shown: list(received) == [n, n], "both images are taken")
    status = graph.diagnostic("pairs", lambda s: s.level == DiagnosticStatus.ERROR)
    assert status.message == "no pair since the start: median skew is 40 ms, pair.slop_s allows 35 ms"
    assert values(status)["pairs"] == "0"


def test_a_publisher_of_other_quality_is_named(graph: Any, node: EdgeMetricNode) -> None:
    lossy = QoSProfile(depth=2, reliability=QoSReliabilityPolicy.BEST_EFFORT)
    graph.client.create_publisher(Image, "left/image_raw", lossy)
    status = graph.diagnostic("qos", lambda s: s.level == DiagnosticStatus.WARN)
    assert "left/image_raw" in status.message
    assert "reliability" in status.message


def test_time_that_goes_back_is_survived(graph: Any, eyes: Eyes) -> None:
    answers(graph, eyes, view(0), view(7))
    eyes.stamp_ns -= 100_000 * MS
    answers(graph, eyes, view(0), view(7))
    status = graph.diagnostic("pairs", lambda s: values(s)["pairs"] == "2")
    assert values(status)["resets"] == "1"


def test_the_overlay_is_drawn_only_for_a_subscriber(graph: Any, eyes: Eyes) -> None:
    answers(graph, eyes, view(0), view(7))
    before = graph.diagnostic("measurement", lambda s: values(s)["measured"] == "1")
    assert "overlay_median_ms" not in values(before)
    picture = graph.message(Image, "vergence/overlay", qos=IMAGE_QOS)
    graph.wait_until(lambda: graph.client.count_publishers("vergence/overlay") > 0, "the overlay is on offer")
    while not picture.done():
        answers(graph, eyes, view(0), view(7))
    assert (picture.result().width, picture.result().height) == (320, 240)
    assert to_nanoseconds(picture.result().header.stamp) <= eyes.stamp_ns


def test_pairs_that_come_too_fast_are_dropped_and_counted_but_the_newest(
    graph: Any, node: EdgeMetricNode, eyes: Eyes, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, go_on = threading.Event(), threading.Event()
    measure = node._measurement.edge

    def slow(left: Pixels, right: Pixels, seen_px: int | None) -> Any:
        begun.set()
        assert go_on.wait(60.0)
        return measure(left, right, seen_px)

    monkeypatch.setattr(node._measurement, "edge", slow)
    eyes.show(view(0), view(7))
    graph.wait_until(begun.is_set, "the first pair is taken up")
    for _ in range(4):
        stamp_ns = eyes.show(view(0), view(7))
        paired = node._stereo._pairer.statistics.pairs + 1
        graph.wait_until(lambda n=paired: node._stereo._pairer.statistics.pairs == n, "the pair is made")
    newest = graph.message(EdgeVergence, "vergence/edge", at(stamp_ns))
    graph.wait_until(lambda: node._edge_publisher.get_subscription_count() > 0, "our subscription is known")
    go_on.set()
    graph.wait(newest)
    status = graph.diagnostic("measurement", lambda s: values(s)["measured"] == "2")
    assert values(status)["dropped"] == "3"
    assert status.level == DiagnosticStatus.WARN
    assert status.message == "measuring is too slow: 3 of 5 pairs were dropped"


def test_a_failure_in_the_measurement_is_named_and_survived(
    graph: Any, node: EdgeMetricNode, eyes: Eyes, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(left: Pixels, right: Pixels, seen_px: int | None) -> Any:
        raise ArithmeticError("of the test")

    with monkeypatch.context() as patch:
        patch.setattr(node._measurement, "edge", fail)
        eyes.show(view(0), view(7))
        status = graph.diagnostic("measurement", lambda s: s.level == DiagnosticStatus.ERROR)
    assert status.message == "measuring the last pair failed: ArithmeticError: of the test"
    answers(graph, eyes, view(0), view(7))
    graph.diagnostic("measurement", lambda s: s.level == DiagnosticStatus.OK)


def test_parameters_change_at_run_time_all_or_none(graph: Any, node: EdgeMetricNode, eyes: Eyes) -> None:
    refused = graph.set_parameters(
        node, **{"edges.windows_px": [60, 120], "edges.canny_low": 90.0, "edges.canny_high": 10.0}
    )
    assert not refused.successful
    assert "canny_low" in refused.reason
    edge, _, _ = answers(graph, eyes, view(0), view(7))
    assert list(edge.windows_px) == [50, 100, 150, 200, 250, 300]
    assert graph.set_parameters(node, **{"edges.windows_px": [60, 120], "edges.threshold_mode": "fixed"}).successful
    edge, _, _ = answers(graph, eyes, view(0), view(7))
    assert list(edge.windows_px) == [60, 120]
    assert len(edge.contrast) == len(edge.status) == 2
    assert not graph.set_parameters(node, image_transport="compressed").successful  # read-only


def test_a_slop_set_at_run_time_is_used(graph: Any, node: EdgeMetricNode, eyes: Eyes) -> None:
    assert graph.set_parameters(node, **{"pair.slop_s": 0.05}).successful
    edge, _, _ = answers(graph, eyes, view(0), view(7), skew_ns=40 * MS)
    assert edge.pair_skew_s == pytest.approx(0.04)


def test_compressed_images_are_taken_too(graph: Any) -> None:
    node = graph.start(EdgeMetricNode, image_transport="compressed")
    graph.node_matched = lambda: node._track_publisher.get_subscription_count() > 0
    eyes = Eyes(graph, compressed=True)
    _, error, _ = answers(graph, eyes, view(0), view(7))
    assert error.horizontal_px == pytest.approx(7.0, abs=0.2)
    message = eyes.image(0, view(0))
    message.data = message.data[:200]
    eyes.images[0].publish(message)
    status = graph.diagnostic("left images", lambda s: values(s)["refused"] == "1")
    assert "cannot be decoded" in status.message


def test_timings_of_every_stage_are_told(graph: Any, eyes: Eyes) -> None:
    answers(graph, eyes, view(0), view(7))
    status = graph.diagnostic("measurement", lambda s: values(s)["measured"] == "1")
    for stage in ("decode", "edges", "metric", "disparity", "tracker", "publish"):
        assert float(values(status)[f"{stage}_median_ms"]) > 0.0
    images = graph.diagnostic("left images", lambda s: "age_median_ms" in values(s))
    assert values(images)["size_px"] == "320x240"


def test_a_request_is_answered_with_its_goals_id(graph: Any, node: EdgeMetricNode, eyes: Eyes) -> None:
    requests = graph.client.create_publisher(TrackRequest, "vergence/track_request", 10)
    graph.wait_until(lambda: requests.get_subscription_count() > 0, "the node subscribes to requests")
    eyes.describe()
    graph.wait_until(lambda: all(node._stereo.models), "the cameras are known")

    def publish_joints() -> None:
        stamp = from_nanoseconds(eyes.stamp_ns + 33 * MS)
        zero = JointState(header=Header(stamp=stamp), name=["pan_left", "pan_right", "tilt"], position=[0.0] * 3)
        eyes.joints.publish(zero)
        graph.wait_until(lambda: node._joints.covers(to_nanoseconds(stamp)), "the joints are known")

    publish_joints()
    answers(graph, eyes, view(0), view(6))
    wanted = TrackRequest(goal_id=9, eye=TrackRequest.EYE_LEFT, x_px=100.0, y_px=80.0)
    wanted.header.stamp = from_nanoseconds(eyes.stamp_ns)
    requests.publish(wanted)
    graph.wait_until(lambda: node._requests, "the request has arrived")
    publish_joints()
    *_, track = answers(graph, eyes, view(0), view(6))
    assert (track.goal_id, track.status) == (9, TargetTrack.STATUS_OK), track.reason
    assert (track.left_x_px, track.left_y_px) == pytest.approx((100.0, 80.0), abs=0.5)
    assert track.disparity_px == pytest.approx(6.0, abs=0.3)


def noisy(image: Pixels, random: np.random.Generator) -> Pixels:
    return np.clip(image + random.normal(0.0, 2.0, image.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("kind", ["frozen", "identical", "black"])
def test_pictures_that_cannot_be_measured_are_named_and_their_figures_are_nan(
    graph: Any, eyes: Eyes, kind: str
) -> None:
    random = np.random.default_rng(1)
    for _ in range(9):
        *_, track = answers(graph, eyes, noisy(view(0), random), noisy(view(7), random))
    assert track.status != TargetTrack.STATUS_UNUSABLE_IMAGES
    graph.diagnostic("pictures", lambda s: s.level == DiagnosticStatus.OK)
    held, black = (noisy(view(0), random), noisy(view(7), random)), np.zeros_like(view(0))
    for _ in range(18):
        same = noisy(view(0), random)
        left, right = {"frozen": held, "identical": (same, same), "black": (black, black)}[kind]
        edge, error, track = answers(graph, eyes, left, right)
    text = {"frozen": "is frozen", "identical": "one camera feeds both", "black": "is black"}[kind]
    assert (track.status, error.status) == (
        TargetTrack.STATUS_UNUSABLE_IMAGES,
        VergenceError.STATUS_UNUSABLE_IMAGES,
    )
    assert text in track.reason
    assert error.reason == track.reason
    assert set(edge.status) == {EdgeVergence.STATUS_UNUSABLE_IMAGES}
    assert not edge.verged
    assert np.isnan(
        [error.horizontal_px, track.contrast, track.left_x_px, *edge.contrast, *edge.left_to_right_px]
    ).all()
    status = graph.diagnostic("pictures", lambda s: text in s.message)
    assert status.level == DiagnosticStatus.ERROR
    *_, track = answers(graph, eyes, noisy(view(0), random), noisy(view(7), random))
    assert track.status != TargetTrack.STATUS_UNUSABLE_IMAGES
    graph.diagnostic("pictures", lambda s: s.level == DiagnosticStatus.OK)
