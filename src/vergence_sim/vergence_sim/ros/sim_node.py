"""sim_node: the simulated head and room in real time, with the topics of cameras, servos and ground truth."""

import functools
import threading
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import Header

from vergence_common.diagnostics import OK, WARN, Diagnostics, Report
from vergence_common.images import array_to_compressed, array_to_image
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import IMAGE_QOS, watch_qos
from vergence_common.stamps import to_stamp
from vergence_msgs.msg import TrueBoxes, TrueVergence
from vergence_rig.rig import JOINT_NAMES, load_rig
from vergence_sim.head import CommandError
from vergence_sim.parameters import GROUPS, SimParameters
from vergence_sim.real_time import Event, Schedule
from vergence_sim.ros.sim_messages import camera_info, joint_state, true_boxes, true_vergence
from vergence_sim.simulator import Simulator, TargetError

Picture = npt.NDArray[np.uint8]

EYES = ("left", "right")


class SimNode(Node):
    """One thread owns the simulator and its OpenGL context; callbacks put commands into a queue that it drains.

    A second thread turns exposures into images (blur, lens, noise, JPEG) while the first goes on rendering.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("sim_node", **options)
        settings = declare(self, GROUPS)
        self._settings = _parameters(settings)
        self._rig = load_rig(self._settings.simulation.rig)
        diagnostics = Diagnostics(self)
        qos = watch_qos(self, diagnostics)
        self._images = {eye: qos.create_publisher(Image, f"{eye}/image_raw", IMAGE_QOS) for eye in EYES}
        self._jpegs = {
            eye: qos.create_publisher(CompressedImage, f"{eye}/image_raw/compressed", IMAGE_QOS) for eye in EYES
        }
        self._infos = {eye: qos.create_publisher(CameraInfo, f"{eye}/camera_info") for eye in EYES}
        self._joints = qos.create_publisher(JointState, "joint_states")
        self._true_joints = qos.create_publisher(JointState, "ground_truth/joint_states")
        self._true_vergence = qos.create_publisher(TrueVergence, "ground_truth/vergence")
        self._true_boxes = qos.create_publisher(TrueBoxes, "ground_truth/boxes")
        self._true_target = qos.create_publisher(PointStamped, "ground_truth/target")
        self._subscriptions_kept = [
            qos.create_subscription(JointState, "joint_command", self._on_command),
            *(
                qos.create_subscription(PointStamped, f"sim/{what}_pose", functools.partial(self._on_place, what))
                for what in ("target", "occluder", "distractor")
            ),
        ]
        settings.on_change(self._on_settings)
        self._commands: deque[tuple[str, Any, float]] = deque()
        self._published = dict.fromkeys(EYES, 0)
        self._dropped = 0
        self._refused: list[str] = []
        self._stop = threading.Event()
        self._started = threading.Event()
        self._failure: BaseException | None = None
        diagnostics.add("cameras", self._report_cameras)
        diagnostics.add("commands", self._report_commands)
        # One thread: a sensor's noise is drawn in the order of its exposures.
        self._image_pool = ThreadPoolExecutor(1, "images")
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)
        self._thread.start()
        # A simulator that cannot start ends the node with its reason.
        self._started.wait()
        if self._failure is not None:
            raise OSError(str(self._failure)) from self._failure
        self.get_logger().info("the simulated head and room are ready")

    def close(self) -> None:
        """End the simulation."""
        self._stop.set()
        self._thread.join(timeout=5.0)
        self._image_pool.shutdown()

    def _now_s(self) -> float:
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def _on_command(self, message: JointState) -> None:
        if len(message.name) != len(message.position):
            self._refuse(
                f"joint_command must give one position per joint: got {len(message.name)} joints with "
                f"{len(message.position)} positions"
            )
            return
        angles = dict(zip(message.name, message.position, strict=True))
        self._commands.append(("command", angles, self._now_s()))

    def _on_place(self, what: str, message: PointStamped) -> None:
        if message.header.frame_id not in ("", "rig_base"):
            self._refuse(f"frame of sim/{what}_pose must be 'rig_base': got {message.header.frame_id!r}")
            return
        self._commands.append((what, (message.point.x, message.point.y, message.point.z), self._now_s()))

    def _on_settings(self, settings: ParameterSet) -> None:
        self._commands.append(("settings", _parameters(settings), self._now_s()))

    def _run(self) -> None:
        try:
            simulator = Simulator(self._settings, self._rig)
        except Exception as error:
            self._failure = error
            self._started.set()
            return
        self._started.set()
        start_s = self._now_s()
        schedule = Schedule(simulator.parameters, 0.0)
        try:
            while not self._stop.is_set():
                now_s = self._now_s() - start_s
                wait_s = schedule.next_due_s() - now_s
                if wait_s > 0:
                    self._stop.wait(min(wait_s, 0.1))
                    continue
                self._drain_commands(simulator, schedule, start_s)
                self._handle(schedule.pop(now_s), simulator, schedule, start_s)
                self._dropped = schedule.dropped
        except Exception as error:
            if self.context.ok():
                self._failure = error
                self.get_logger().fatal(f"the simulation stopped: {type(error).__name__}: {error}")
        finally:
            simulator.close()

    def _drain_commands(self, simulator: Simulator, schedule: Schedule, start_s: float) -> None:
        while self._commands:
            kind, value, arrived_s = self._commands.popleft()
            try:
                if kind == "command":
                    simulator.command(value, arrived_s - start_s)
                elif kind == "target":
                    simulator.place_target(simulator.parameters.target.object, value)
                elif kind == "occluder":
                    simulator.place_occluder(value)
                elif kind == "distractor":
                    simulator.place_distractor(value)
                else:
                    simulator.set_parameters(value)
                    schedule.set_jitter(value.effective().camera.frame_jitter_s)
            except (CommandError, TargetError) as error:
                self._refuse(str(error))

    def _handle(self, event: Event, simulator: Simulator, schedule: Schedule, start_s: float) -> None:
        if event.kind == "publish":
            self._publish_image(event.eye, *event.payload)  # type: ignore[misc]
            return
        simulator.advance_to(event.due_s)
        stamp = to_stamp(start_s + simulator.time_s)
        if event.kind == "joints":
            self._joints.publish(joint_state(stamp, simulator.joint_states()))
            if self._true_joints.get_subscription_count():
                self._true_joints.publish(joint_state(stamp, simulator.true_joints()))
            return
        header = Header(stamp=stamp, frame_id=f"{event.eye}_camera_optical_frame")
        picture = self._image_pool.submit(simulator.expose(event.eye))
        info = camera_info(header, simulator.lenses[event.eye])
        schedule.publish(event.eye, event.due_s + simulator.parameters.camera.latency_s, (header, picture, info))
        if event.eye == "left":
            self._publish_truth(stamp, simulator)

    def _publish_image(self, eye: str, header: Header, picture: "Future[Picture]", info: CameraInfo) -> None:
        if self._images[eye].get_subscription_count():
            self._images[eye].publish(array_to_image(picture.result(), header))
        if self._jpegs[eye].get_subscription_count():
            self._jpegs[eye].publish(array_to_compressed(picture.result(), header))
        self._infos[eye].publish(info)
        self._published[eye] += 1

    def _publish_truth(self, stamp: Any, simulator: Simulator) -> None:
        if self._true_vergence.get_subscription_count() or self._true_target.get_subscription_count():
            truth = true_vergence(stamp, "rig_base", simulator.truth())
            self._true_vergence.publish(truth)
            self._true_target.publish(PointStamped(header=truth.header, point=truth.target_point))
        if self._true_boxes.get_subscription_count():
            boxes = [simulator.true_boxes(eye) for eye in EYES]
            self._true_boxes.publish(true_boxes(stamp, "left_camera_optical_frame", *boxes))

    def _refuse(self, reason: str) -> None:
        self._refused.append(reason)
        self.get_logger().warning(f"command refused, nothing moves: {reason}", throttle_duration_sec=1.0)

    def _report_cameras(self) -> Report:
        values: dict[str, object] = {f"{eye}_published": count for eye, count in self._published.items()}
        values["dropped"], rate_hz = self._dropped, self._settings.camera.frame_rate_hz
        if self._failure is not None:
            return Report(WARN, f"the simulation stopped: {self._failure}", values)
        if self._dropped:
            return Report(
                WARN, f"this machine is too slow for {rate_hz:g} Hz: {self._dropped} exposures dropped", values
            )
        return Report(OK, f"both cameras run at {rate_hz:g} Hz", values)

    def _report_commands(self) -> Report:
        if self._refused:
            values = {"refused": len(self._refused), "joints": ", ".join(JOINT_NAMES)}
            return Report(WARN, f"{len(self._refused)} commands refused, the last: {self._refused[-1]}", values)
        return Report(OK, "no command refused")


def _parameters(settings: ParameterSet) -> SimParameters:
    return SimParameters(*(settings.get(group) for _, group in GROUPS))  # type: ignore[arg-type]


def main(args: Sequence[str] | None = None) -> int:
    """Run the node; see `vergence_common.node_main`."""
    return run_node(SimNode, args)
