"""sim_node in a graph: it speaks as cameras, servos and truth, and refuses what cannot be."""

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState

from vergence_common.images import compressed_to_array, image_to_array
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_nanoseconds
from vergence_msgs.msg import TrueBoxes, TrueVergence
from vergence_sim.printed_head import printed_head
from vergence_sim.ros.sim_node import SimNode

pytestmark = [pytest.mark.graph, pytest.mark.usefixtures("opengl")]


@pytest.fixture
def sim(graph: Any) -> SimNode:
    # Slow frames: many tests may share this machine.
    node: SimNode = graph.start(
        SimNode, **{"head.model": "rolled", "camera.frame_rate_hz": 10.0, "right_camera.clock_offset_s": 0.02}
    )
    return node


def test_both_eyes_come_with_their_stamps_frames_and_calibration(graph: Any, sim: SimNode) -> None:
    left = graph.message(Image, "left/image_raw", qos=IMAGE_QOS)
    right = graph.message(Image, "right/image_raw", qos=IMAGE_QOS)
    info = graph.message(CameraInfo, "left/camera_info")
    jpeg = graph.message(CompressedImage, "right/image_raw/compressed", qos=IMAGE_QOS)
    pictures = {"left": graph.wait(left), "right": graph.wait(right)}
    for eye, message in pictures.items():
        assert message.header.frame_id == f"{eye}_camera_optical_frame"
        assert image_to_array(message).shape == (480, 640, 3)
        age_s = (graph.client.get_clock().now().nanoseconds - to_nanoseconds(message.header.stamp)) * 1e-9
        assert 0.04 < age_s < 20
    skew_ns = to_nanoseconds(pictures["right"].header.stamp) - to_nanoseconds(pictures["left"].header.stamp)
    # Any two frames differ by the offset and whole periods.
    periods = (skew_ns * 1e-9 - 0.02) / 0.1
    assert periods == pytest.approx(round(periods), abs=0.05)
    calibration = graph.wait(info)
    assert (calibration.width, calibration.height, calibration.k[0]) == (640, 480, 539.0)
    assert list(calibration.d) == [-0.04, 0.02, 0.0, 0.0, 0.0]
    assert compressed_to_array(graph.wait(jpeg)).shape == (480, 640, 3)


def test_the_diagnostics_name_what_they_are_about(graph: Any, sim: SimNode) -> None:
    assert graph.diagnostic("sim_node: cameras", lambda status: True).hardware_id == "simulated head"


def test_a_command_turns_the_head_and_the_truth_follows(graph: Any, sim: SimNode) -> None:
    command = graph.client.create_publisher(JointState, "joint_command", 10)
    graph.wait_until(command.get_subscription_count, "sim_node to listen")
    turning = graph.message(
        JointState, "joint_states", lambda m: dict(zip(m.name, m.velocity, strict=True))["pan_left"] > 0.5
    )
    command.publish(JointState(name=["pan_left", "tilt"], position=[0.2, -0.1]))
    assert graph.wait(turning).name == ["pan_left", "pan_right", "tilt"]
    arrived = graph.wait(graph.message(JointState, "joint_states", lambda m: 0.2 in m.position and -0.1 in m.position))
    angles = dict(zip(arrived.name, arrived.position, strict=True))
    assert angles == pytest.approx({"pan_left": 0.2, "pan_right": 0.0, "tilt": -0.1})
    truth = graph.wait(graph.message(TrueVergence, "ground_truth/vergence", lambda m: m.pan_left_rad > 0.15))
    assert truth.pan_left_rad == pytest.approx(0.2, abs=0.02)
    assert truth.tilt_rad == pytest.approx(-0.1, abs=0.02)


@pytest.mark.parametrize(
    ("names", "positions", "words"),
    [
        (["pan_left", "neck"], [0.3, 0.1], "neck"),
        (["pan_left"], [math.nan], "nan"),
        (["pan_left", "tilt"], [0.3], "2 joints with 1 positions"),
    ],
)
def test_a_command_that_cannot_be_is_refused_by_name_and_nothing_moves(
    graph: Any, sim: SimNode, names: list[str], positions: list[float], words: str
) -> None:
    command = graph.client.create_publisher(JointState, "joint_command", 10)
    graph.wait_until(command.get_subscription_count, "sim_node to listen")
    command.publish(JointState(name=names, position=positions))
    status = graph.diagnostic("commands", lambda s: s.level != b"\x00")
    assert words in status.message
    joints = graph.wait(graph.message(JointState, "joint_states"))
    assert list(joints.position) == [0.0, 0.0, 0.0]


def test_persons_are_in_the_room_and_move(graph: Any) -> None:
    try:
        graph.start(SimNode, **{"persons.count": 2, "persons.motion": "cross", "target.z_m": -5.0, "preset": "ideal"})
    except OSError as error:
        pytest.skip(f"no OpenGL here: {error}")
    boxes = graph.wait(graph.message(TrueBoxes, "ground_truth/boxes", lambda m: len(m.left) == 2))
    assert [box.class_name for box in boxes.left] == ["person", "person"]
    first_px = boxes.left[0].x_min_px
    graph.wait(graph.message(TrueBoxes, "ground_truth/boxes", lambda m: abs(m.left[0].x_min_px - first_px) > 20.0))


def test_a_target_goes_where_it_is_put(graph: Any, sim: SimNode) -> None:
    place = graph.client.create_publisher(PointStamped, "sim/target_pose", 10)
    graph.wait_until(place.get_subscription_count, "sim_node to listen")
    message = PointStamped()
    message.header.frame_id = "rig_base"
    message.point.x, message.point.y = 0.5, 0.1
    place.publish(message)
    truth = graph.wait(
        graph.message(TrueVergence, "ground_truth/vergence", lambda m: abs(m.target_point.y - 0.0943) < 1e-3)
    )
    assert truth.target == "cube"
    assert truth.left_visible_share == 1.0
    boxes = graph.wait(graph.message(TrueBoxes, "ground_truth/boxes", lambda m: bool(m.left)))
    box = boxes.left[0]
    assert box.x_min_px < truth.left_x_px < box.x_max_px
    assert box.y_min_px < truth.left_y_px < box.y_max_px
    occluder = graph.client.create_publisher(PointStamped, "sim/occluder_pose", 10)
    graph.wait_until(occluder.get_subscription_count, "sim_node to listen")
    message.point.x, message.point.y = 0.3, 0.06
    occluder.publish(message)
    graph.wait(graph.message(TrueVergence, "ground_truth/vergence", lambda m: m.left_visible_share == 0.0))
    message.point.y = 2.0
    occluder.publish(message)
    graph.wait(graph.message(TrueVergence, "ground_truth/vergence", lambda m: m.left_visible_share > 0.5))
    distractor = graph.client.create_publisher(PointStamped, "sim/distractor_pose", 10)
    graph.wait_until(distractor.get_subscription_count, "sim_node to listen")
    message.point.y = 0.06
    distractor.publish(message)
    graph.wait(graph.message(TrueVergence, "ground_truth/vergence", lambda m: m.left_visible_share < 0.5))
    message.header.frame_id = "map"
    place.publish(message)
    status = graph.diagnostic("commands", lambda s: "map" in s.message)
    assert "rig_base" in status.message


def test_parameters_change_while_it_runs(graph: Any, sim: SimNode) -> None:
    seen: list[np.ndarray] = []

    def clean(message: Image) -> bool:
        """True for a picture like the one before it, to the last bit: nothing moves, and there is no noise."""
        seen.append(image_to_array(message).copy())
        return len(seen) > 1 and bool((seen[-1] == seen[-2]).all())

    for _ in range(3):
        assert not clean(graph.wait(graph.message(Image, "left/image_raw", qos=IMAGE_QOS)))
    result = graph.set_parameters(sim, **{"camera.noise_sigma": 0.0, "camera.jpeg_quality": 0})
    assert result.successful
    graph.wait(graph.message(Image, "left/image_raw", clean, qos=IMAGE_QOS))
    refused = graph.set_parameters(sim, **{"camera.noise_sigma": 0.0, "motion.kind": "backwards"})
    assert not refused.successful
    assert "backwards" in refused.reason


@pytest.mark.parametrize(
    ("camera_info", "k"), [("none", (0.0, 0.0, 0.0)), ("nominal", (539.0, 319.5, 239.5)), ("calibrated", None)]
)
def test_a_printed_heads_cameras_say_of_themselves_what_is_asked_for(
    graph: Any, camera_info: str, k: tuple[float, float, float] | None
) -> None:
    node = {"head.model": "printed", "head.seed": 2, "head.camera_info": camera_info, "camera.frame_rate_hz": 5.0}
    graph.start(SimNode, **node)
    info = graph.wait(graph.message(CameraInfo, "right/camera_info"))
    assert (info.width, info.height) == (640, 480)
    true = printed_head(2).right_camera
    assert (info.k[0], info.k[2], info.k[5]) == (k or (true.fx_px, true.cx_px, true.cy_px))
    assert len(info.d) == (0 if camera_info == "none" else 5)
