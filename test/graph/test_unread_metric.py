"""edge_metric_node while nothing reads what it measures: a point that is then requested is found all the same."""

from typing import Any

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Header

from vergence_common.images import array_to_image
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_metric.ros import metric_node
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_msgs.msg import TargetTrack, TrackRequest
from vergence_msgs.srv import GetStoredImage
from vergence_rig.rig import JOINT_NAMES

pytestmark = pytest.mark.graph

PERIOD_NS = 33_000_000
DISPARITY_PX = 6
CLICKED_PX = (250.0, 200.0)


def views() -> list[np.ndarray]:
    """What both eyes see of one wall (480, 640, 3)."""
    noise = cv2.GaussianBlur(np.random.default_rng(5).normal(size=(480, 740, 3)), (0, 0), 2.0)
    wall = np.clip(125 + 45 * noise / noise.std(), 0, 255).astype(np.uint8)
    return [np.ascontiguousarray(wall[:, x : x + 640]) for x in (40, 40 + DISPARITY_PX)]


class Head:
    """Publishes resting joints and images, and requests a point."""

    def __init__(self, graph: Any, node: EdgeMetricNode) -> None:
        self._graph, self._node, client = graph, node, graph.client
        self.images = [client.create_publisher(Image, f"{eye}/image_raw", IMAGE_QOS) for eye in ("left", "right")]
        self._joints = client.create_publisher(JointState, "joint_states", 10)
        self._requests = client.create_publisher(TrackRequest, "vergence/track_request", 10)
        self.stamp_ns = client.get_clock().now().nanoseconds
        graph.wait_until(lambda: self._joints.get_subscription_count() > 0, "the node subscribes to joints")
        graph.wait_until(lambda: self._requests.get_subscription_count() > 0, "the node subscribes to requests")

    def connected(self) -> None:
        for publisher in self.images:
            self._graph.wait_until(lambda p=publisher: p.get_subscription_count() > 0, "images are subscribed")

    def rest(self) -> None:
        """Publish the joints at the next stamp."""
        self.stamp_ns += PERIOD_NS
        stamp = from_nanoseconds(self.stamp_ns)
        self._joints.publish(JointState(header=Header(stamp=stamp), name=list(JOINT_NAMES), position=[0.0] * 3))
        self._graph.wait_until(lambda: self._node._joints.covers(self.stamp_ns), "the joints are known")

    def show(self) -> int:
        """Publish joints and a pair, and return their stamp [ns]."""
        self.rest()
        worked = self._node._worker.worked
        for publisher, pixels in zip(self.images, views(), strict=True):
            header = Header(stamp=from_nanoseconds(self.stamp_ns))
            publisher.publish(array_to_image(pixels, header))
        self._graph.wait_until(lambda: self._node._worker.worked > worked, "the pair is taken up")
        return self.stamp_ns

    def request(self, stamp_ns: int) -> None:
        x_px, y_px = CLICKED_PX
        request = TrackRequest(goal_id=7, eye=TrackRequest.EYE_LEFT, x_px=x_px, y_px=y_px)
        request.header.stamp = from_nanoseconds(stamp_ns)
        self._requests.publish(request)
        self._graph.wait_until(lambda: self._node._requests, "the request has arrived")

    def answer(self) -> TargetTrack:
        """Read the tracks and return the first for the request."""
        answer = self._graph.message(TargetTrack, "vergence/track", lambda track: track.goal_id == 7)
        self._graph.wait_until(lambda: self._node._subscribers() > 0, "the track is read")
        self.connected()
        self.show()
        track: TargetTrack = self._graph.wait(answer)
        return track


def test_pairs_are_remembered_and_nothing_is_measured_in_them(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = graph.start(EdgeMetricNode)
    head = Head(graph, node)
    head.connected()
    measured, edge = list[int](), node._measurement.edge

    def counted(*images: Any) -> Any:
        measured.append(1)
        return edge(*images)

    monkeypatch.setattr(node._measurement, "edge", counted)
    clicked_ns = head.show()
    for _ in range(3):
        head.show()
    assert not measured
    head.request(clicked_ns)
    track = head.answer()
    assert measured
    assert track.status == TargetTrack.STATUS_OK, track.reason
    assert (track.left_x_px, track.left_y_px) == pytest.approx(CLICKED_PX, abs=0.5)


@pytest.mark.parametrize("found", [True, False])
def test_cameras_are_asked_for_an_image_that_was_not_received(
    graph: Any, monkeypatch: pytest.MonkeyPatch, found: bool
) -> None:
    monkeypatch.setattr(metric_node, "_UNHEARD_S", 0.0)
    asked: list[int] = []

    def serve(pixels: np.ndarray) -> Any:
        def answer(request: GetStoredImage.Request, response: GetStoredImage.Response) -> GetStoredImage.Response:
            asked.append(to_nanoseconds(request.stamp))
            response.found, response.header.stamp = found, request.stamp
            response.jpeg = cv2.imencode(".jpg", pixels)[1].tobytes()
            return response

        return answer

    for eye, pixels in zip(("left", "right"), views(), strict=True):
        graph.client.create_service(GetStoredImage, f"{eye}/get_stored_image", serve(pixels))
    node = graph.start(EdgeMetricNode)
    head = Head(graph, node)
    graph.wait_until(lambda: node._stereo.paused, "no images are received")
    head.rest()
    clicked_ns = head.stamp_ns
    head.rest()
    head.request(clicked_ns)
    assert asked == [clicked_ns] * 2
    if found:
        track = head.answer()
        assert track.status == TargetTrack.STATUS_OK, track.reason
        assert (track.left_x_px, track.left_y_px) == pytest.approx(CLICKED_PX, abs=0.5)
        assert track.disparity_px == pytest.approx(DISPARITY_PX, abs=0.3)
    else:
        graph.message(TargetTrack, "vergence/track")
        graph.wait_until(lambda: node._subscribers() > 0, "the track is read")
        head.connected()
        head.show()
        graph.wait_until(lambda: "no pair is stored for goal 7" in node._measurement.unmet_request, "it is named")
