"""servo_node: turns joint commands on topics into servo pulses within all limits."""

import dataclasses
import time
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from vergence_common.diagnostics import Diagnostics, Report
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import watch_qos
from vergence_common.stamps import to_nanoseconds
from vergence_common.two_rates import TwoRates
from vergence_servo.command_guard import (
    CommandRefusedError,
    StampGuard,
    StampLimits,
    named_positions,
    ordered_positions,
)
from vergence_servo.commanders import conflict
from vergence_servo.drivers.registry import find_backend
from vergence_servo.parameters import ServoNodeParameters, parameter_groups
from vergence_servo.ros import servo_messages as convert
from vergence_servo.ros.trajectory_server import NAME as TRAJECTORY_ACTION
from vergence_servo.ros.trajectory_server import make_trajectory_server
from vergence_servo.servo_channel import RetryParameters, ServoChannel
from vergence_servo.servo_hardware import ServoHardware
from vergence_servo.servo_head import Mode
from vergence_servo.servo_reports import CommandCounts, channel_report, commands_report, head_report
from vergence_servo.trajectory import Trajectory, check_end, start_delay_s

_RESTING_AFTER_S = 0.2  # without motion, from when joint_states come at a lower rate
_RESTING_PERIOD_S = 0.1  # of joint_states then, and of time-outs while no servo is under way

COMMAND_TOPICS = ("joint_command", "~/commands", "joint_trajectory")


class ServoNode(Node):
    """Connects ServoHead to topics, services, timers and diagnostics."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("servo_node", **node_options)
        self._settings = declare(self, parameter_groups())
        values: ServoNodeParameters = self._settings.value
        self._hardware = ServoHardware(
            values,
            self._settings.get(RetryParameters),
            lambda backend: dataclasses.asdict(self._settings.get(backend.parameters)),
        )
        self._head, self._drivers = self._hardware.head, self._hardware.drivers
        self._stamps = self._new_stamp_guard(values)
        self._settings.on_change(self._changed)
        self._counts = CommandCounts()
        self._conflict = ""
        self._reported_rad: tuple[float, dict[str, float]] = (time.monotonic(), {})
        self._begin(values)
        self._connect(values)

    def _begin(self, values: ServoNodeParameters) -> None:
        for backend in map(find_backend, self._drivers.by_backend):
            if backend.warning:
                self.get_logger().warning(backend.warning)
        if not values.enabled:
            self._head.enable(False, time.monotonic())
        elif values.start == "last_pose" and self._hardware.pose:
            self._head.attach_all(time.monotonic())
        elif values.start == "last_pose":
            self.get_logger().warning(f"no last pose in {self._hardware.pose_file}: the servos start released")

    def _connect(self, values: ServoNodeParameters) -> None:
        diagnostics = Diagnostics(self, self._drivers.description())
        diagnostics.add("servos", lambda: head_report(self._head, self._drivers, self._hardware.guardians))
        diagnostics.add("commands", lambda: commands_report(self._counts, self._conflict, time.monotonic()))
        for channel in self._head.channels.values():
            diagnostics.add(channel.name, partial(self._report_channel, channel))
        watch = watch_qos(self, diagnostics)
        self._states = watch.create_publisher(JointState, "joint_states")
        latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        self._resolution = watch.create_publisher(JointState, "~/resolution", latched)
        self._resolution.publish(convert.resolution(self.get_clock().now().to_msg(), self._hardware.steps_rad))
        watch.create_subscription(JointState, "joint_command", self._on_command)
        watch.create_subscription(Float64MultiArray, "~/commands", self._on_commands)
        watch.create_subscription(JointTrajectory, "joint_trajectory", self._on_trajectory)
        self._trajectories = make_trajectory_server(self, self._head, self._start_trajectory)
        self.create_service(SetBool, "~/enable", self._on_enable)
        self.create_service(Trigger, "~/park", lambda request, response: self._on_trigger(self._head.park, response))
        self.create_service(
            Trigger, "~/release", lambda request, response: self._on_trigger(self._head.release, response)
        )
        # Servos are real also beside simulated time: their time-outs must not stand with /clock.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        # Between motions an update is for time-outs and the guardian's heartbeat alone.
        moving_s, standing_s = 1.0 / values.update_rate_hz, min(_RESTING_PERIOD_S, 0.1 * values.guardian_timeout_s)
        self._updates = TwoRates(self, self._step, moving_s, max(moving_s, standing_s), steady)
        self._moved_s, period_s = time.monotonic(), 1.0 / values.state_rate_hz
        self._reports = TwoRates(self, self._on_report, period_s, max(period_s, _RESTING_PERIOD_S), steady)
        self.create_timer(1.0, self._check_commanders, clock=steady)

    def _step(self) -> None:
        pause_s = self._hardware.step()
        if self._trajectories is not None:
            self._trajectories.update(time.monotonic())
        if pause_s:
            self.get_logger().error(f"this node hung for {pause_s:.1f} s: its guardian has released the servos")
        self._updates.set_fast(self._head.under_way)

    @staticmethod
    def _report_channel(channel: ServoChannel) -> Report:
        return channel_report(channel, time.monotonic())

    def _on_command(self, message: JointState) -> None:
        def apply(now_s: float) -> None:
            positions = named_positions(message.name, message.position, tuple(self._head.channels))
            self._check_stamp(message)
            self._head.command(positions, now_s)

        self._execute("joint_command", apply)

    def _on_commands(self, message: Float64MultiArray) -> None:
        def apply(now_s: float) -> None:
            self._head.command(ordered_positions(message.data, tuple(self._head.channels)), now_s)

        self._execute("~/commands", apply)

    def _on_trajectory(self, message: JointTrajectory) -> None:
        self._execute("joint_trajectory", lambda now_s: self._follow(message, now_s))

    def _start_trajectory(self, message: JointTrajectory) -> float:
        """Follow a trajectory of the action and return when it begins [s]; raises CommandRefusedError."""
        begin_s: list[float] = []
        refusal = self._execute(TRAJECTORY_ACTION, lambda now_s: begin_s.append(self._follow(message, now_s)))
        if refusal is not None:
            raise refusal
        return begin_s[0]

    def _follow(self, message: JointTrajectory, now_s: float) -> float:
        points = convert.trajectory_points(message)
        trajectory = Trajectory(message.joint_names, points, self._head.sent_rad())
        stamp_ns, now_ns = to_nanoseconds(message.header.stamp), self.get_clock().now().nanoseconds
        values: ServoNodeParameters = self._settings.value
        delay_s = start_delay_s(stamp_ns, now_ns, values.command_max_age_s)
        check_end(delay_s + trajectory.duration_s, values.trajectory_max_s)
        self._head.follow(trajectory, now_s + delay_s, now_s)
        return now_s + delay_s

    def _execute(self, topic: str, apply: Callable[[float], object]) -> CommandRefusedError | None:
        now_s = time.monotonic()
        try:
            apply(now_s)
        except CommandRefusedError as error:
            self._counts.refuse(topic, str(error), now_s)
            self.get_logger().warning(f"{topic} refused: {error}", throttle_duration_sec=1.0)
            return error
        self._counts.accept(topic, now_s)
        self._head.step(now_s)
        self._end_rest()
        return None

    def _end_rest(self) -> None:
        """Step and report at the full rate where something is to move, the pose before the motion first."""
        self._updates.set_fast(self._head.under_way)
        if not self._head.at_rest and self._reports.set_fast(True):
            self._publish_state()

    def _check_stamp(self, message: JointState) -> None:
        self._stamps.check(to_nanoseconds(message.header.stamp), self.get_clock().now().nanoseconds)

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._head.enable(request.data, time.monotonic())
        response.success, response.message = True, self._head.mode.value
        return response

    def _on_trigger(self, act: Callable[[float], None], response: Trigger.Response) -> Trigger.Response:
        try:
            act(time.monotonic())
            self._end_rest()
            response.success, response.message = True, self._head.mode.value
        except CommandRefusedError as error:
            response.success, response.message = False, str(error)
        return response

    def _on_report(self) -> None:
        if time.monotonic() - self._moved_s > _RESTING_AFTER_S:
            self._reports.set_fast(False)
        self._publish_state()

    def _publish_state(self) -> None:
        now_s = time.monotonic()
        positions = self._head.positions_rad(now_s)
        before_s, before = self._reported_rad
        elapsed_s = max(now_s - before_s, 1e-3)
        velocities = {name: (position - before.get(name, position)) / elapsed_s for name, position in positions.items()}
        self._reported_rad = (now_s, positions)
        if not self._head.at_rest:
            self._moved_s = now_s
        self._states.publish(convert.joint_state(self.get_clock().now().to_msg(), positions, velocities))

    def _check_commanders(self) -> None:
        found = conflict(convert.commanders(self, COMMAND_TOPICS))
        if found and found != self._conflict:
            self.get_logger().error(found)
        self._conflict = found
        if self._head.mode is not Mode.COMMANDED:
            self._save_pose()

    def _save_pose(self) -> None:
        try:
            self._hardware.save_pose()
        except OSError as error:
            self.get_logger().warning(f"the last pose cannot be saved: {error}", throttle_duration_sec=60.0)

    def _changed(self, settings: ParameterSet) -> None:
        self._hardware.set_parameters(settings.value, settings.get(RetryParameters))
        self._stamps = self._new_stamp_guard(settings.value)

    @staticmethod
    def _new_stamp_guard(values: ServoNodeParameters) -> StampGuard:
        return StampGuard(StampLimits(values.command_max_age_s, values.command_max_ahead_s, values.command_timeout_s))

    def close(self) -> None:
        """Park, release everything and free the hardware."""
        self._hardware.park()
        self._save_pose()
        self._hardware.close()


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run_node(ServoNode, args, parameter_groups())


if __name__ == "__main__":
    raise SystemExit(main())
