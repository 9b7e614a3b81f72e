"""Identifying's view of a running head: what it records, whom it silences, and that it leaves all as it found it."""

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import Header

from vergence_calibration.identification.axis_log import EYES, IdentifyError, Move
from vergence_calibration.identification.identified_rig import nodes_text
from vergence_calibration.ros.identified_head import IdentifiedHead
from vergence_calibration.ros.running_head import HeadError
from vergence_common.images import array_to_compressed, array_to_image
from vergence_common.qos import IMAGE_QOS
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_msgs.msg import GazeState
from vergence_rig.rig import JOINT_NAMES, default_rig
from vergence_servo.ros.servo_node import ServoNode

pytestmark = pytest.mark.graph

TIMEOUT_S = 60.0


class PaleHead(Node):
    """Publishes both eyes' images, joint_states of what it is commanded, and has the parameters that owners have."""

    def __init__(
        self,
        context: Context,
        listens: bool = True,
        sees: bool = True,
        compressed: bool = False,
        stamp_age_s: float = 0,
    ) -> None:
        super().__init__("pale_head", context=context)
        self.position = {"pan_left": -0.1, "pan_right": 0.1, "tilt": 0.05}
        self.commanded: list[dict[str, float]] = []
        self._compressed, self._age_s = compressed, stamp_age_s
        self.declare_parameter("stamp_offset_s", 0.003)
        self.declare_parameter("command_latency_s", 0.015)
        if listens:
            self.create_subscription(JointState, "joint_command", self._on_command, 10)
        kind, suffix = (CompressedImage, "/compressed") if compressed else (Image, "")
        self._images = {eye: self.create_publisher(kind, f"{eye}/image_raw{suffix}", IMAGE_QOS) for eye in EYES}
        self._infos = {eye: self.create_publisher(CameraInfo, f"{eye}/camera_info", IMAGE_QOS) for eye in EYES}
        self._joints = self.create_publisher(JointState, "joint_states", 10)
        if sees:
            self.create_timer(0.04, self._show)
        self.create_timer(0.02, self._report)

    def _on_command(self, message: JointState) -> None:
        self.position |= dict(zip(message.name, message.position, strict=True))
        self.commanded.append(dict(self.position))

    def _show(self) -> None:
        stamp = self.get_clock().now() - rclpy.duration.Duration(seconds=self._age_s)
        header = Header(stamp=stamp.to_msg())
        picture = np.full((48, 64, 3), 90, np.uint8)
        for eye in EYES:
            message = array_to_compressed(picture, header) if self._compressed else array_to_image(picture, header)
            self._images[eye].publish(message)
        focal = [50.0, 0.0, 32.0, 0.0, 50.0, 24.0, 0.0, 0.0, 1.0]
        self._infos["left"].publish(
            CameraInfo(header=header, width=64, height=48, k=focal, distortion_model="plumb_bob")
        )
        self._infos["right"].publish(CameraInfo(header=header, width=64, height=48))  # not calibrated

    def _report(self) -> None:
        message = JointState(name=list(self.position), position=list(self.position.values()))
        message.header.stamp = self.get_clock().now().to_msg()
        self._joints.publish(message)


Start = Callable[..., Any]


@pytest.fixture
def start(domain_id: int) -> Iterator[Start]:
    """Start nodes that spin in a thread until the test's end."""
    context = Context()
    rclpy.init(context=context)
    executor = SingleThreadedExecutor(context=context)
    nodes: list[Node] = []

    ending = threading.Event()

    def spin() -> None:
        try:
            while not ending.is_set():
                executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            return

    def begin(kind: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        nodes.append(kind(*arguments, context=context, **options))
        executor.add_node(nodes[-1])
        return nodes[-1]

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    yield begin
    ending.set()  # first the thread: an executor that is shut down under it fails in the middle of its waiting
    thread.join(60)
    executor.shutdown()
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


def wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline_s = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline_s, f"never: {what}"
        time.sleep(0.02)


@pytest.mark.parametrize("compressed", [False, True])
def test_moves_are_recorded_and_the_head_is_left_where_it_was(start: Start, compressed: bool) -> None:
    node = start(PaleHead, compressed=compressed)
    with IdentifiedHead(default_rig(), timeout_s=TIMEOUT_S) as head:
        assert head.begin() == []
        wait_for(lambda: len(head.published_models()) == 1, "camera_info")
        cameras = head.cameras()
        assert {eye: camera.calibrated for eye, camera in cameras.items()} == {"left": True, "right": False}
        assert (cameras["left"].model.fx_px, cameras["right"].model.fx_px) == (50.0, 539.0)
        moves = [Move(-0.02, 0.2, 0.5), Move(0.03, 0.2, 0.0)]
        log = head.record("tilt", moves)
        owners = head.owners()
    assert log.commands[:, 1].tolist() == [-0.02, 0.03]
    assert next(commanded["tilt"] for commanded in node.commanded if commanded["tilt"] != 0.05) == pytest.approx(0.03)
    assert max(commanded["tilt"] for commanded in node.commanded) == pytest.approx(0.08)
    assert all(commanded["pan_left"] == pytest.approx(-0.1) for commanded in node.commanded)
    assert node.position == pytest.approx({"pan_left": -0.1, "pan_right": 0.1, "tilt": 0.05})
    assert set(np.round(log.reports[:, 1], 6)) >= {0.03, 0.08}
    for eye in EYES:
        frames = log.frames[eye]
        assert frames.pictures[0].shape == (48, 64)
        assert frames.stamps_s[-1] >= log.commands[-1, 0] + 0.2
        assert all(b > a for a, b in zip(frames.stamps_s, frames.stamps_s[1:]))  # noqa: B905
        assert all(a > s for a, s in zip(frames.arrivals_s, frames.stamps_s, strict=True))
    assert {eye: owner.value_s for eye, owner in owners.cameras.items()} == {"left": 0.003, "right": 0.003}
    assert owners.servos is not None
    assert (owners.servos.name, owners.servos.value_s) == ("/pale_head", 0.015)


def test_the_head_looks_from_a_pose_and_returns(start: Start) -> None:
    node = start(PaleHead)
    with IdentifiedHead(default_rig(), timeout_s=TIMEOUT_S) as head:
        head.begin()
        commanded = {"pan_left": -0.05, "pan_right": 0.12, "tilt": 0.02}
        look = head.look(commanded)
        assert node.position == pytest.approx(commanded)
    assert look.joints_rad == pytest.approx(list(commanded.values()))
    for eye in EYES:
        assert look.pictures[eye].shape == (48, 64)
        assert look.sizes_px[eye] == (64, 48)
    assert node.position == pytest.approx({"pan_left": -0.1, "pan_right": 0.1, "tilt": 0.05})


@pytest.mark.parametrize("before", ["idle", "verging", "disabled"])
def test_a_controller_is_silenced_and_gets_its_way_back(start: Start, before: str) -> None:
    node = start(PaleHead)
    begins = Parameter("start", value="verge" if before == "verging" else "idle")
    controller = start(GazeControllerNode, parameter_overrides=[begins])
    states: list[GazeState] = []
    node.create_subscription(GazeState, "gaze/state", states.append, 10)
    if before == "disabled":
        controller._controller.enable(False, 0.0)
    wait_for(lambda: bool(states) and (states[-1].phase == GazeState.PHASE_IDLE) == (before != "verging"), before)
    with IdentifiedHead(default_rig(), timeout_s=TIMEOUT_S) as head:
        wait_for(lambda: head._controllers._state is not None, "gaze/state published")
        wait_for(lambda: head._controllers.others() == ["/gaze_controller_node"], "the controller known")
        assert head.begin() == ["/gaze_controller_node"]
        assert not controller._controller._enabled
        count = len(node.commanded)
        head.record("pan_left", [Move(0.02, 0.2, 0.0)])
        assert len(node.commanded) > count
    if before == "disabled":
        assert not controller._controller._enabled
        return
    wait_for(lambda: controller._controller._enabled, "enabled again")
    wait_for(lambda: (states[-1].phase == GazeState.PHASE_IDLE) == (before == "idle"), "as before")


def test_somebody_elses_commands_are_refused_with_a_name(start: Start) -> None:
    start(PaleHead)
    rival = start(Node, "stubborn")
    publisher = rival.create_publisher(JointState, "joint_command", 10)
    rival.create_timer(0.02, lambda: publisher.publish(JointState(name=["tilt"], position=[0.2])))
    wait_for(lambda: publisher.get_subscription_count() > 0, "matched")
    with (
        pytest.raises(
            IdentifyError, match=r"joint_command must have no commands of other nodes .* got \d+ of /stubborn"
        ),
        IdentifiedHead(default_rig(), timeout_s=TIMEOUT_S) as head,
    ):
        head.begin()


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"listens": False}, HeadError, "no node subscribes to joint_command: start servo_node"),
        ({"sees": False}, IdentifyError, "no images on left/image_raw and right/image_raw for 2 s"),
        ({"stamp_age_s": 100.0}, IdentifyError, r"stamps of left/image_raw must be -0\.2 to 5 s old: got 10\d\.\d s"),
    ],
)
def test_heads_that_cannot_be_used_are_refused(
    start: Start, options: dict[str, Any], error: type[Exception], text: str
) -> None:
    start(PaleHead, **options)
    timeout_s = 2.0 if "listens" in options else TIMEOUT_S
    with IdentifiedHead(default_rig(), timeout_s=timeout_s) as head:
        subscribe = head._subscribe_to_images

        def subscribe_and_soon_give_up() -> None:
            subscribe()
            head._timeout_s = TIMEOUT_S if "stamp_age_s" in options else 2.0

        head._subscribe_to_images = subscribe_and_soon_give_up  # type: ignore[method-assign]
        with pytest.raises(error, match=text):
            head.begin()


def test_eyes_that_close_in_the_middle_are_refused(start: Start) -> None:
    node = start(PaleHead)
    with IdentifiedHead(default_rig(), timeout_s=TIMEOUT_S) as head:
        head.begin()
        head._timeout_s = 1.0
        for timer in list(node.timers)[:1]:
            timer.cancel()
        with pytest.raises(IdentifyError, match="no images on left/image_raw and right/image_raw for 1 s"):
            head.record("tilt", [Move(0.02, 0.2, 0.0)])
    assert node.position["tilt"] == pytest.approx(0.05)
    assert set(node.position) == set(JOINT_NAMES)


def test_the_nodes_own_file_reaches_them(domain_id: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    path = tmp_path / "rig.nodes.yaml"
    values = {"/left/camera_node": {"stamp_offset_s": 0.012}, "/servo_node": {"command_latency_s": 0.04}}
    path.write_text(nodes_text({name: {"ros__parameters": own} for name, own in values.items()}))
    context = Context()
    shipped = Path(__file__).parents[2] / "config" / "servo_node.yaml"
    rclpy.init(args=["--ros-args", "--params-file", str(shipped), "--params-file", str(path)], context=context)
    servos = ServoNode(context=context)
    assert servos.get_parameter("command_latency_s").value == 0.04
    camera = Node(
        "camera_node", namespace="left", context=context, automatically_declare_parameters_from_overrides=True
    )
    assert camera.get_parameter("stamp_offset_s").value == 0.012
    other = Node(
        "camera_node", namespace="right", context=context, automatically_declare_parameters_from_overrides=True
    )
    assert not other.has_parameter("stamp_offset_s")
    servos.close()
    for node in (servos, camera, other):
        node.destroy_node()
    context.try_shutdown()
