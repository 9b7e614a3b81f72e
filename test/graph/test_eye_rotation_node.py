"""eye_rotation_node in one process with the rendered eyes of an SG90 head: what it reads, and what it refuses."""

import math
from contextlib import closing
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import Header

from vergence_common.images import array_to_compressed, array_to_image
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_metric.ros.eye_rotation_node import EyeRotationNode
from vergence_msgs.msg import EyeRotation
from vergence_rig.rig import JOINT_NAMES, default_rig
from vergence_sim.heads import rolled_head
from vergence_sim.parameters import SimParameters
from vergence_sim.simulator import Simulator, StereoFrame

pytestmark = pytest.mark.graph

MS = 1_000_000
PERIOD_NS, SKEW_NS = 33 * MS, 5 * MS
TRUE_RAD = {"pan_left": -0.025, "pan_right": 0.04, "tilt": 0.1}
SAID_RAD = {"pan_left": -0.02, "pan_right": 0.037, "tilt": 0.1}
HEAD = rolled_head(default_rig())


@pytest.fixture(scope="module")
def seen() -> StereoFrame:
    """One pair of a room, and how the eyes stood."""
    with closing(Simulator(SimParameters(), default_rig(), head=HEAD)) as simulator:
        simulator.set_head(TRUE_RAD)
        return simulator.capture()


class Head:
    """Publishes resting eyes and their joints, one pair after another, from stamps of its own."""

    def __init__(self, graph: Any, compressed: bool = False, **parameters: Any) -> None:
        self.graph, self._compressed = graph, compressed
        transport = "compressed" if compressed else "raw"
        self.node: EyeRotationNode = graph.start(EyeRotationNode, image_transport=transport, **parameters)
        self.said_rad = dict(SAID_RAD)
        self._shown = 0
        node = graph.client
        kind, suffix = (CompressedImage, "image_raw/compressed") if compressed else (Image, "image_raw")
        self.images = [node.create_publisher(kind, f"{eye}/{suffix}", IMAGE_QOS) for eye in ("left", "right")]
        self.infos = [node.create_publisher(CameraInfo, f"{eye}/camera_info", 10) for eye in ("left", "right")]
        self.joints = node.create_publisher(JointState, "joint_states", 50)
        self.answers: list[EyeRotation] = []
        node.create_subscription(EyeRotation, "vergence/eye_rotation", self.answers.append, 10)
        self.stamp_ns = 1_700_000_000_000_000_000
        for publisher in (*self.images, *self.infos, self.joints):
            graph.wait_until(lambda p=publisher: p.get_subscription_count() > 0, "the node subscribes")

    def describe(self) -> None:
        camera = default_rig().left_camera
        k = [camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0]
        for publisher in self.infos:
            publisher.publish(
                CameraInfo(
                    width=640, height=480, k=k, d=list(HEAD.left_camera.distortion), distortion_model="plumb_bob"
                )
            )

    def show(self, left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8], turn_rad: float = 0.0) -> None:
        """One more pair; the joints have turned by `turn_rad` since the last one."""
        self.stamp_ns += PERIOD_NS
        for share in (0.0, 0.5, 1.0):
            self._joints_ns = self.stamp_ns + round(share * (PERIOD_NS - MS))
            stamp = from_nanoseconds(self._joints_ns)
            positions = [self.said_rad[name] + self.turned(turn_rad) for name in JOINT_NAMES]
            self.joints.publish(JointState(header=Header(stamp=stamp), name=list(JOINT_NAMES), position=positions))
        for side, pixels in enumerate((left, right)):
            header = Header(stamp=from_nanoseconds(self.stamp_ns + side * SKEW_NS), frame_id=("left", "right")[side])
            message = array_to_compressed(pixels, header, 95) if self._compressed else array_to_image(pixels, header)
            self.images[side].publish(message)
        # One pair at a time: the queues are short, and the node and this test share one executor.
        self._shown += 1
        self.graph.wait_until(self._all_arrived, "the node takes a pair and its joints")

    def _all_arrived(self) -> bool:
        received = self.node._stereo._pairer.statistics.received
        joints = self.node._joints
        return min(received) >= self._shown and joints.known and joints.newest.stamp >= self._joints_ns

    def turned(self, turn_rad: float) -> float:
        return turn_rad * ((self.stamp_ns // PERIOD_NS) % 2)

    def until(self, status: int, left: Any, right: Any, turn_rad: float = 0.0, described: bool = True) -> EyeRotation:
        """Show the same pair again and again until an answer has this status; stamps pass, however slow the machine."""
        self.answers.clear()

        def answered() -> bool:
            if not any(answer.status == status for answer in self.answers):
                if described:
                    self.describe()
                self.show(left, right, turn_rad)
                return False
            return True

        self.graph.wait_until(answered, f"an answer with status {status}")
        return next(answer for answer in self.answers if answer.status == status)


@pytest.fixture
def head(graph: Any) -> Head:
    return Head(graph)


def is_silent(message: EyeRotation) -> bool:
    angles = (message.vergence_rad, message.sigma_rad, *message.corrections_rad, *message.covariance_rad2)
    return all(math.isnan(angle) for angle in angles) and bool(message.reason)


@pytest.mark.parametrize("compressed", [False, True])
def test_the_true_vergence_is_read_although_the_joints_are_off(graph: Any, seen: StereoFrame, compressed: bool) -> None:
    head = Head(graph, compressed)
    message = head.until(EyeRotation.STATUS_OK, seen.left, seen.right)
    true = TRUE_RAD["pan_right"] - TRUE_RAD["pan_left"]
    assert message.joint_vergence_rad == pytest.approx(SAID_RAD["pan_right"] - SAID_RAD["pan_left"])
    assert message.vergence_rad == pytest.approx(true, abs=math.radians(0.12))
    assert abs(message.vergence_rad - true) < 4.0 * message.sigma_rad < math.radians(0.3)
    assert message.corrections_rad[0] == pytest.approx(message.vergence_rad - message.joint_vergence_rad)
    assert message.corrections_rad[2] == pytest.approx(HEAD.right_mount.pitch_rad, abs=2e-3)
    assert message.covariance_rad2[0] == pytest.approx(message.sigma_rad**2)
    assert message.header.frame_id == "left"
    assert to_nanoseconds(message.header.stamp) <= head.stamp_ns
    assert message.pair_skew_s == pytest.approx(0.005)
    assert message.corners >= message.matches >= message.inliers >= 60
    assert message.reason == ""


def test_moving_eyes_are_not_measured(head: Head, seen: StereoFrame) -> None:
    # Until the joints reach back far enough, that is the reason; the turn comes to light after it.
    reasons: list[str] = []
    while not any("a joint moved by" in reason for reason in reasons):
        message = head.until(EyeRotation.STATUS_MOVING, seen.left, seen.right, turn_rad=0.05)
        assert is_silent(message)
        reasons.append(message.reason)
        assert len(reasons) < 50


def test_a_blank_view_has_too_few_features(head: Head) -> None:
    blank = np.full((480, 640, 3), 90, np.uint8)
    message = head.until(EyeRotation.STATUS_FEW_FEATURES, blank, blank)
    assert is_silent(message)
    assert message.matches == 0


def test_unrelated_views_are_refused(head: Head, seen: StereoFrame) -> None:
    upside_down = np.ascontiguousarray(seen.right[::-1])
    head.until(EyeRotation.STATUS_FEW_FEATURES, seen.left, upside_down)
    assert not any(answer.status == EyeRotation.STATUS_OK for answer in head.answers)


def test_without_camera_info_the_message_has_no_angles(head: Head, seen: StereoFrame) -> None:
    assert is_silent(head.until(EyeRotation.STATUS_NO_CAMERA_INFO, seen.left, seen.right, described=False))


def test_what_the_servos_cannot_be_is_contradictory_and_a_diagnostic(graph: Any, seen: StereoFrame) -> None:
    tolerance: dict[str, Any] = {"acceptance.mount_tolerance_rad": 0.001}
    head = Head(graph, **tolerance)
    head.said_rad["pan_right"] -= 0.018
    message = head.until(EyeRotation.STATUS_CONTRADICTORY, seen.left, seen.right)
    assert "servos and mounts allow" in message.reason
    assert is_silent(message)
    status = graph.diagnostic("encoder", lambda s: s.level == DiagnosticStatus.WARN)
    assert "contradict the joint angles" in status.message


def test_a_changed_rule_holds_from_the_next_pair_on(graph: Any, seen: StereoFrame) -> None:
    head = Head(graph)
    head.until(EyeRotation.STATUS_OK, seen.left, seen.right)
    assert graph.set_parameters(head.node, **{"acceptance.max_sigma_rad": 1e-5}).successful
    message = head.until(EyeRotation.STATUS_UNCERTAIN, seen.left, seen.right)
    assert "standard deviation" in message.reason
    refused = graph.set_parameters(head.node, rate_hz=0.0)
    assert not refused.successful
    assert "rate_hz" in refused.reason


def test_broken_images_are_named(graph: Any) -> None:
    head = Head(graph, compressed=True)
    for number in range(6):
        head.stamp_ns += PERIOD_NS
        for side, publisher in enumerate(head.images):
            stamp = from_nanoseconds(head.stamp_ns + side * SKEW_NS)
            publisher.publish(CompressedImage(header=Header(stamp=stamp), format="jpeg", data=[number] * 9))
    status = graph.diagnostic("left images", lambda s: s.level == DiagnosticStatus.ERROR)
    assert "image_raw/compressed" in status.message
