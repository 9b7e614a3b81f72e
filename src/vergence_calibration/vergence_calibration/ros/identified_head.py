"""The running head for the identification: commands moves and records images and joint_states meanwhile."""

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Any

import numpy as np
from sensor_msgs.msg import CompressedImage, JointState
from sensor_msgs.msg import Image as RawImage

from vergence_calibration.geometry.identify_geometry import Look
from vergence_calibration.identification.axis_log import EYES, AxisLog, EyeCamera, Frames, IdentifyError, Move
from vergence_calibration.identification.node_parameters import Owner, Owners
from vergence_calibration.identification.pose import pose_with_room
from vergence_calibration.identification.seen_motion import WIDTH_PX, shrunk
from vergence_calibration.ros.controllers import Controllers, number_of
from vergence_calibration.ros.running_head import REPEAT_S, RunningHead
from vergence_common.images import ImageError, compressed_to_array, image_to_array
from vergence_common.qos import IMAGE_QOS, STATE_QOS
from vergence_common.stamps import to_nanoseconds, to_seconds
from vergence_rig.camera import CameraModel
from vergence_rig.rig import JOINT_NAMES, Rig

TRANSPORTS = ("auto", "raw", "compressed")

_CHECK_COMMANDS_S = 0.6
_START_S = 1.0
_FRAMES_AT_REST = 3
_AHEAD_S, _OLD_S = 0.2, 5.0
_RETURN_S = 3.0
_RETURNED_RAD = 0.02
_WHOLE_TURN_RAD = math.tau
_LOOK_WIDTH_PX = 640
_LOOK_REST_S = 0.4


class IdentifiedHead(RunningHead):
    """A head in use: on leaving the block the eyes return to their pose, and the controller is enabled again.

    `timeout_s` is the longest wait for images, joint_states and a subscriber of commands.
    """

    def __init__(self, rig: Rig, namespace: str = "", transport: str = "auto", timeout_s: float = 20.0) -> None:
        super().__init__("vergence_identify", namespace, own_signals=True)
        self._rig, self._transport, self._timeout_s = rig, transport, timeout_s
        self._controllers = Controllers(self.node, "joint_command")
        self._own_ns: deque[int] = deque(maxlen=500)
        self._foreign = 0
        self._present: dict[str, float] = {}
        self._before: dict[str, float] = {}
        self._reports: list[tuple[float, dict[str, float]]] | None = None
        self._frames: dict[str, Frames] | None = None
        self._width_px = WIDTH_PX
        self._sizes_px: dict[str, tuple[int, int]] = {}
        self._newest: dict[str, list[float]] = {eye: [] for eye in EYES}
        self._problem = ""
        self._topics: dict[str, str] = {}
        self.node.create_subscription(JointState, "joint_command", self._on_command, STATE_QOS)
        self.node.create_subscription(JointState, "joint_states", self._on_joints, STATE_QOS)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._return()
            unresponsive = self._controllers.resume()
            if unresponsive:
                self.node.get_logger().error(f"{', '.join(unresponsive)} did not answer and may still be disabled")
        finally:
            super().__exit__(kind, error, trace)

    def begin(self) -> list[str]:
        """Find cameras and servos, disable controllers, and check that no other node commands.

        Returns the names of the controllers that were disabled. Raises HeadError, IdentifyError.
        """
        self.wait_for_servos(self._timeout_s)
        self._wait(lambda: len(self._present) == len(JOINT_NAMES), self._no_joints)
        self._subscribe_to_images()
        self._wait(lambda: all(self._newest.values()), self._no_images)
        self._check_clocks()
        self._controllers.pause()
        time.sleep(0.1)  # commands on their way
        with self.arrival:
            self._foreign = 0
        time.sleep(_CHECK_COMMANDS_S)
        self._check_alone()
        with self.arrival:
            self._before = dict(self._present)
        # released servos start one after the other, and jump to their estimated position
        self._rest(self.command(self._before), _START_S)
        return [controller.name for controller in self._controllers.paused]

    def cameras(self) -> dict[str, EyeCamera]:
        """Return the cameras by eye: by camera_info, else by the rig."""
        published = self.published_models()
        specs = {"left": self._rig.left_camera, "right": self._rig.right_camera}
        return {eye: EyeCamera(published.get(eye) or CameraModel(specs[eye]), eye in published) for eye in EYES}

    def record(self, joint: str, moves: Sequence[Move]) -> AxisLog:
        """See Head."""
        amplitude_rad = max(abs(move.angle_rad) for move in moves)
        pose = pose_with_room(self._rig, self._before, amplitude_rad)
        self._rest(self.command(pose), moves[0].rest_s)
        with self.arrival:
            self._frames, self._reports = {eye: Frames() for eye in EYES}, []
        self._wait(lambda: all(f.stamps_s for f in (self._frames or {}).values()), self._no_images)
        commands = []
        for move in moves:
            stamp_s = self.command(pose | {joint: pose[joint] + move.angle_rad})
            commands.append((stamp_s, move.angle_rad))
            self._rest(stamp_s, move.rest_s)
            time.sleep(move.share * self._interval_s())
            self._check_alone()
        with self.arrival:
            frames, reports = self._frames or {}, self._reports or []
            self._frames = self._reports = None
        rows = [(stamp_s, positions[joint]) for stamp_s, positions in reports if joint in positions]
        return AxisLog(joint, np.array(commands), np.array(rows, float).reshape(-1, 2), frames)

    def look(self, joints_rad: Mapping[str, float]) -> Look:
        """See LookingHead; the joints' angles are those reported while both pictures were taken."""
        self._rest(self.command(joints_rad), _LOOK_REST_S)
        self._check_alone()
        with self.arrival:
            self._frames, self._width_px = {eye: Frames() for eye in EYES}, _LOOK_WIDTH_PX
        try:
            self._wait(lambda: all(f.stamps_s for f in (self._frames or {}).values()), self._no_images)
            with self.arrival:
                pictures = {eye: frames.pictures[0] for eye, frames in (self._frames or {}).items()}
                return Look([self._present[name] for name in JOINT_NAMES], pictures, dict(self._sizes_px))
        finally:
            with self.arrival:
                self._frames, self._width_px = None, WIDTH_PX

    def owners(self) -> Owners:
        """Return the nodes that have latencies as parameters, and their values."""
        cameras = {}
        for eye, topic in self._topics.items():
            name = self._publisher(topic)
            offset_s = number_of(self.node, name, "stamp_offset_s") if name else None
            if offset_s is not None:
                cameras[eye] = Owner(name, offset_s)
        servos = self._publisher("joint_states")
        latency_s = number_of(self.node, servos, "command_latency_s") if servos else None
        return Owners(cameras, Owner(servos, latency_s) if latency_s is not None else None)

    def _publisher(self, topic: str) -> str:
        infos = self.node.get_publishers_info_by_topic(self.node.resolve_topic_name(topic))
        names = {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos}
        return names.pop() if len(names) == 1 else ""

    def _subscribe_to_images(self) -> None:
        deadline_s = time.monotonic() + self._timeout_s
        kinds: dict[str, Any] = {"raw": RawImage, "compressed": CompressedImage}
        for eye in EYES:
            names = {"raw": f"{eye}/image_raw", "compressed": f"{eye}/image_raw/compressed"}
            wanted = [name for name in names if self._transport in ("auto", name)]
            while not (offered := [name for name in wanted if self.node.count_publishers(names[name])]):
                if time.monotonic() > deadline_s:
                    raise IdentifyError(
                        f"no node publishes {' or '.join(names[name] for name in wanted)}: start the cameras first"
                    )
                time.sleep(0.05)
            self._topics[eye] = names[offered[0]]
            self.node.create_subscription(
                kinds[offered[0]], names[offered[0]], lambda message, eye=eye: self._on_image(eye, message), IMAGE_QOS
            )

    def _on_image(self, eye: str, message: Any) -> None:
        arrival_s = self.now_s()
        stamp_s = to_seconds(message.header.stamp)
        picture = None
        if self._frames is not None:
            try:
                whole = (
                    compressed_to_array(message) if isinstance(message, CompressedImage) else image_to_array(message)
                )
                self._sizes_px[eye] = (whole.shape[1], whole.shape[0])
                picture = shrunk(whole, self._width_px)
            except ImageError as error:
                self._problem = f"{self._topics[eye]}: {error}"
        with self.arrival:
            newest = self._newest[eye]
            newest.append(stamp_s)
            del newest[:-30]
            if self._frames is not None and picture is not None:
                self._frames[eye].add(stamp_s, arrival_s, picture)
            self.arrival.notify_all()

    def _on_joints(self, message: JointState) -> None:
        positions = {
            name: position
            for name, position in zip(message.name, message.position)  # noqa: B905 - another node's message
            if name in JOINT_NAMES and abs(position) < _WHOLE_TURN_RAD
        }
        with self.arrival:
            self._present |= positions
            if self._reports is not None:
                self._reports.append((to_seconds(message.header.stamp), positions))
            self.arrival.notify_all()

    def _on_command(self, message: JointState) -> None:
        with self.sending:
            own = to_nanoseconds(message.header.stamp) in self._own_ns
        if not own:
            self._foreign += 1

    def on_command_sent(self, stamp_ns: int) -> None:
        """See RunningHead; called with `sending` held."""
        self._own_ns.append(stamp_ns)

    def _check_clocks(self) -> None:
        for eye, newest in self._newest.items():
            age_s = self.now_s() - newest[-1]
            if not -_AHEAD_S <= age_s <= _OLD_S:
                raise IdentifyError(
                    f"stamps of {self._topics[eye]} must be {-_AHEAD_S:g} to {_OLD_S:g} s old: got {age_s:.1f} s; do "
                    "the machines' clocks agree (docs/two_machines.md)?"
                )

    def _check_alone(self) -> None:
        if self._foreign:
            names = ", ".join(self._controllers.others()) or "an unknown node"
            raise IdentifyError(
                f"joint_command must have no commands of other nodes during the identification: got {self._foreign} of "
                f"{names}; stop that node first"
            )

    def _rest(self, since_s: float, rest_s: float) -> None:
        """Wait until both eyes have images of the end of a rest; by their stamps, independent of their arrival."""

        def rested() -> bool:
            return all(
                newest and newest[-1] >= since_s + rest_s and sum(s > since_s for s in newest) >= _FRAMES_AT_REST
                for newest in self._newest.values()
            )

        self._wait(rested, self._no_images)

    def _wait(self, condition: Any, explanation: Any) -> None:
        """Wait for a condition; the time-out restarts with every image."""
        with self.arrival:
            while not condition():
                counts = {eye: newest[-1:] for eye, newest in self._newest.items()}
                if not self.arrival.wait_for(condition, self._timeout_s):
                    stuck = [eye for eye, newest in self._newest.items() if newest[-1:] == counts[eye]]
                    if stuck or not self._newest:
                        raise IdentifyError(explanation(stuck))

    def _no_images(self, stuck: Sequence[str]) -> str:
        if self._problem:
            return self._problem
        topics = " and ".join(self._topics.get(eye, f"{eye}/image_raw") for eye in stuck)
        return f"no images on {topics} for {self._timeout_s:g} s; do the cameras run?"

    def _no_joints(self, stuck: Sequence[str]) -> str:
        missing = ", ".join(name for name in JOINT_NAMES if name not in self._present)
        return f"no joint_states of {missing} for {self._timeout_s:g} s; does servo_node run?"

    def _interval_s(self) -> float:
        with self.arrival:
            stamps = list(self._newest["left"])
        return float(np.median(np.diff(stamps))) if len(stamps) > 2 else 0.033

    def _return(self) -> None:
        if not self._before:
            return
        self.command(self._before)
        deadline_s = time.monotonic() + _RETURN_S
        while time.monotonic() < deadline_s and not self._is_back():
            time.sleep(0.05)
        time.sleep(3 * REPEAT_S)
        self.command({})

    def _is_back(self) -> bool:
        with self.arrival:
            present: Mapping[str, float] = dict(self._present)
        return all(abs(present[name] - angle) < _RETURNED_RAD for name, angle in self._before.items())
