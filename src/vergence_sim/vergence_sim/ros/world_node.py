"""What sim_node and photo_node share: a lockstep world in real or simulated time, and the topics of the hardware."""

import functools
import threading
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState
from std_msgs.msg import Header

from vergence_common.diagnostics import OK, WARN, Diagnostics, Report
from vergence_common.images import array_to_compressed, array_to_image
from vergence_common.node_main import StartAbandonedError
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import IMAGE_QOS, watch_qos
from vergence_common.stamps import to_nanoseconds, to_stamp
from vergence_rig.head_bodies import OPTICAL_FRAMES
from vergence_rig.parameters import Groups
from vergence_rig.rig import JOINT_NAMES
from vergence_sim.clock_parameters import ClockParameters
from vergence_sim.joint_speeds import JointSpeeds
from vergence_sim.parameters import SimParameters
from vergence_sim.real_time import Event, Schedule
from vergence_sim.ros.clock_server import START_NS, ClockServer
from vergence_sim.ros.sim_messages import camera_info, joint_state
from vergence_sim.world import EYES, Picture, World

_ROUNDING_S = 1e-6
_ASKED_EVERY_S = 0.05


class WorldNode(Node):
    """One thread owns the world; callbacks put commands into a queue that it drains.

    A second thread turns exposures into images (blur, lens, noise, JPEG) while the first goes on. Subclasses say what
    the world is, what of it is true, and which further commands it takes; their `_prepare` runs before the thread does.

    With use_sim_time the node owns /clock, and simulated time waits for the nodes that follow it.
    """

    def __init__(self, name: str, groups: Groups, **options: Any) -> None:
        super().__init__(name, **options)
        self._settings = declare(self, groups)
        self._diagnostics = Diagnostics(self, "simulated head")
        self._qos = qos = watch_qos(self, self._diagnostics)
        self._images = {eye: qos.create_publisher(Image, f"{eye}/image_raw", IMAGE_QOS) for eye in EYES}
        self._jpegs = {
            eye: qos.create_publisher(CompressedImage, f"{eye}/image_raw/compressed", IMAGE_QOS) for eye in EYES
        }
        self._infos = {eye: qos.create_publisher(CameraInfo, f"{eye}/camera_info") for eye in EYES}
        self._joints = qos.create_publisher(JointState, "joint_states")
        self._true_joints = qos.create_publisher(JointState, "ground_truth/joint_states")
        self._command_subscription = qos.create_subscription(JointState, "joint_command", self._on_command)
        self._settings.on_change(self._on_settings)
        self._actions: deque[tuple[float, Callable[[Any, float], None]]] = deque()
        self._published = dict.fromkeys(EYES, 0)
        self._reported_speeds, self._true_speeds = JointSpeeds(), JointSpeeds()
        self._dropped = 0
        self._refused, self._refusal = 0, ""
        self._stop = threading.Event()
        self._started = threading.Event()
        self._failure: BaseException | None = None
        self._diagnostics.add("cameras", self._report_cameras)
        self._diagnostics.add("commands", self._report_commands)
        # One thread: a sensor's noise is drawn in the order of its exposures.
        self._image_pool = ThreadPoolExecutor(1, "images")
        self._prepare(self._settings)
        self._clock_server: ClockServer | None = None
        if self.get_parameter("use_sim_time").value:
            period_s = 1.0 / self._sim_parameters(self._settings).camera.frame_rate_hz
            self._clock_server = ClockServer(
                self, lambda: self._settings.get(ClockParameters), 0.5 * period_s, qos, self._diagnostics
            )
        self._start_s = START_NS * 1e-9
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)
        self._thread.start()
        # A world that cannot start ends the node with its reason. Making one takes seconds: a node that is asked to end
        # meanwhile does not wait for it.
        while not self._started.wait(_ASKED_EVERY_S):
            if not self.context.ok():
                raise StartAbandonedError
        if self._failure is not None:
            raise OSError(str(self._failure)) from self._failure

    def close(self) -> None:
        """End the simulation."""
        self._stop.set()
        if self._clock_server is not None:
            self._clock_server.wake()
        self._thread.join(timeout=5.0)
        self._image_pool.shutdown()

    def _prepare(self, settings: ParameterSet) -> None:
        """Read the parameters and make the subclass's own publishers and subscriptions; may raise ValueError."""
        raise NotImplementedError

    def _make_world(self) -> World:
        """Return the world; called in the thread that will own it."""
        raise NotImplementedError

    def _sim_parameters(self, settings: ParameterSet) -> SimParameters:
        """Return the node's parameters as the world takes them."""
        raise NotImplementedError

    def _publish_truth(self, stamp: Any, world: Any) -> None:
        """Publish what is true at a left exposure."""
        raise NotImplementedError

    def _do(self, action: Callable[[Any], None]) -> None:
        """Have the world's thread do something with the world; a ValueError refuses it."""
        self._add_action(lambda world, _: action(world))

    def _refuse(self, reason: str) -> None:
        self._refused, self._refusal = self._refused + 1, reason
        self.get_logger().warning(f"command refused, nothing moves: {reason}", throttle_duration_sec=1.0)

    def _add_action(self, action: Callable[[Any, float], None]) -> None:
        self._actions.append((self._now_s(), action))
        if self._clock_server is not None:
            self._clock_server.wake()

    def _now_s(self) -> float:
        if self._clock_server is not None:
            return self._clock_server.now_s
        return float(self.get_clock().now().nanoseconds) * 1e-9

    def _on_command(self, message: JointState) -> None:
        if len(message.name) != len(message.position):
            self._refuse(
                f"joint_command must give one position per joint: got {len(message.name)} joints with "
                f"{len(message.position)} positions"
            )
            return
        angles = dict(zip(message.name, message.position, strict=True))
        latency_s = self._settings.get(ClockParameters).command_latency_s if self._clock_server is not None else 0.0
        self._add_action(functools.partial(_command, angles, latency_s))

    def _on_settings(self, settings: ParameterSet) -> None:
        parameters = self._sim_parameters(settings)
        self._do(lambda world: world.set_parameters(parameters))

    def _run(self) -> None:
        try:
            world = self._make_world()
        except Exception as error:
            self._failure = error
            self._started.set()
            return
        self._started.set()
        schedule = Schedule(world.parameters, 0.0)
        try:
            if self._clock_server is None:
                self._run_in_real_time(world, schedule)
            else:
                self._run_in_simulated_time(world, schedule, self._clock_server)
        except Exception as error:
            if self.context.ok():
                self._failure = error
                self.get_logger().fatal(f"the simulation stopped: {type(error).__name__}: {error}")
        finally:
            world.close()

    def _run_in_real_time(self, world: World, schedule: Schedule) -> None:
        self._start_s = self._now_s()
        while not self._stop.is_set():
            now_s = self._now_s() - self._start_s
            wait_s = schedule.next_due_s() - now_s
            if wait_s > 0:
                self._stop.wait(min(wait_s, 0.1))
                continue
            self._drain_actions(world, schedule)
            self._handle(schedule.pop(now_s), world, schedule)
            self._dropped = schedule.dropped

    def _run_in_simulated_time(self, world: World, schedule: Schedule, clock: ClockServer) -> None:
        while self._wait(clock.may_advance, clock, world, schedule):
            next_s = clock.next_s - self._start_s + _ROUNDING_S
            while schedule.next_due_s() <= next_s:
                self._handle(schedule.pop(schedule.next_due_s()), world, schedule)
            # What is measured in the images so far arrives before the tick.
            if self._wait(clock.is_followed, clock, world, schedule):
                clock.advance()

    def _wait(self, condition: Callable[[], bool], clock: ClockServer, world: World, schedule: Schedule) -> bool:
        """Wait for a condition and do what is commanded meanwhile; return False if the node ends instead."""
        while not self._stop.is_set():
            clock.update()
            self._drain_actions(world, schedule)
            if condition():
                return True
            clock.wait()
        return False

    def _drain_actions(self, world: World, schedule: Schedule) -> None:
        while self._actions:
            arrived_s, action = self._actions.popleft()
            try:
                action(world, arrived_s - self._start_s)
            except ValueError as error:
                self._refuse(str(error))
            schedule.set_jitter(world.parameters.camera.frame_jitter_s)

    def _handle(self, event: Event, world: World, schedule: Schedule) -> None:
        if event.kind == "publish":
            self._publish_image(event.eye, *event.payload)  # type: ignore[misc]
            return
        world.advance_to(event.due_s)
        stamp = to_stamp(self._start_s + world.time_s)
        if event.kind == "joints":
            reported, true = world.joint_states(), world.true_joints()
            self._joints.publish(joint_state(stamp, reported, self._reported_speeds.at(world.time_s, reported)))
            true_speeds = self._true_speeds.at(world.time_s, true)
            if self._true_joints.get_subscription_count():
                self._true_joints.publish(joint_state(stamp, true, true_speeds))
            return
        header = Header(stamp=stamp, frame_id=OPTICAL_FRAMES[event.eye])
        picture = self._image_pool.submit(world.expose(event.eye))
        info = camera_info(header, world.lenses[event.eye].camera, world.calibrations[event.eye])
        latency_s = world.parameters.camera.latency_s
        if self._clock_server is not None:
            latency_s += self._settings.get(ClockParameters).image_latency_s
        schedule.publish(event.eye, event.due_s + latency_s, (header, picture, info))
        if event.eye == "left":
            self._publish_truth(stamp, world)

    def _publish_image(self, eye: str, header: Header, picture: "Future[Picture]", info: CameraInfo) -> None:
        if self._images[eye].get_subscription_count():
            self._images[eye].publish(array_to_image(picture.result(), header))
        if self._jpegs[eye].get_subscription_count():
            self._jpegs[eye].publish(array_to_compressed(picture.result(), header))
        self._infos[eye].publish(info)
        self._published[eye] += 1
        if self._clock_server is not None:
            self._clock_server.add_image(eye, to_nanoseconds(header.stamp))

    def _report_cameras(self) -> Report:
        values: dict[str, object] = {f"{eye}_published": count for eye, count in self._published.items()}
        values["dropped"], rate_hz = self._dropped, self._sim_parameters(self._settings).camera.frame_rate_hz
        if self._failure is not None:
            return Report(WARN, f"the simulation stopped: {self._failure}", values)
        if self._dropped:
            return Report(
                WARN, f"this machine is too slow for {rate_hz:g} Hz: {self._dropped} exposures dropped", values
            )
        return Report(OK, f"both cameras run at {rate_hz:g} Hz", values)

    def _report_commands(self) -> Report:
        if self._refused:
            values = {"refused": self._refused, "joints": ", ".join(JOINT_NAMES)}
            return Report(WARN, f"{self._refused} commands refused, the last: {self._refusal}", values)
        return Report(OK, "no command refused")


def _command(angles_rad: Mapping[str, float], latency_s: float, world: World, sent_s: float) -> None:
    world.command(angles_rad, sent_s + latency_s)
