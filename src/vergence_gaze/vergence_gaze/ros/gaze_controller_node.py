"""gaze_controller_node: steers the eyes by what the metric nodes say, and answers gaze/look_at."""

import math
from typing import Any

import numpy as np
from geometry_msgs.msg import PointStamped
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import CameraInfo, JointState
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from vergence_common.diagnostics import OK, WARN, Diagnostics, Report
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import watch_qos
from vergence_common.stamps import to_seconds
from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import Command
from vergence_gaze.estimation.observations import Observation, PointSighting
from vergence_gaze.goals.goal import Outcome, Result
from vergence_gaze.joints.frames import FrameError
from vergence_gaze.parameters import GROUPS, GazeNodeParameters
from vergence_gaze.ros import gaze_messages as convert
from vergence_msgs.action import LookAt
from vergence_msgs.msg import BoxVergence, EdgeVergence, EyeRotation, GazeState, TargetTrack, VergenceError
from vergence_rig.camera import CameraModel, CameraModelError
from vergence_rig.rig import load_rig

_FEEDBACK_EVERY = 10
_MARKERS_EVERY = 10


class GazeControllerNode(Node):
    """The rim of GazeController: messages in, a control timer, messages out."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("gaze_controller_node", **node_options)
        self._settings = declare(self, GROUPS)
        values: GazeNodeParameters = self._settings.value
        self._rig = load_rig(values.rig)
        self._left, self._right = CameraModel(self._rig.left_camera), CameraModel(self._rig.right_camera)
        self._controller = GazeController(self._rig, values, 1.0 / values.control_rate_hz)
        self._settings.on_change(self._changed)
        self._arrived: list[Observation] = []
        self._goals: dict[int, tuple[ServerGoalHandle, Future]] = {}
        self._newest: Command | None = None
        self._cycles = 0
        self._tf_buffer = _tf_buffer(self)

        diagnostics = Diagnostics(self)
        diagnostics.add("gaze", self._gaze_health)
        watch = watch_qos(self, diagnostics)
        self._command = watch.create_publisher(JointState, "joint_command")
        self._state = watch.create_publisher(GazeState, "gaze/state")
        self._fixation = watch.create_publisher(PointStamped, "gaze/fixation_point")
        self._markers = watch.create_publisher(MarkerArray, "gaze/markers", QoSProfile(depth=1))
        watch.create_subscription(JointState, "joint_states", lambda m: self._take(convert.joint_report(m)))
        # Latched: one message per start of the servos' driver.
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        watch.create_subscription(
            JointState, "servo_node/resolution", lambda m: self._take(convert.joint_resolution(m)), latched
        )
        watch.create_subscription(EdgeVergence, "vergence/edge", lambda m: self._take(convert.edge_judgement(m)))
        watch.create_subscription(
            VergenceError, "vergence/error", lambda m: self._take(convert.fovea_disparity(m, self._left.fx_px))
        )
        watch.create_subscription(
            TargetTrack, "vergence/track", lambda m: self._take(convert.track_sighting(m, self._left))
        )
        watch.create_subscription(
            BoxVergence, "vergence/box", lambda m: self._take(convert.box_sighting(m, self._left.fx_px))
        )
        watch.create_subscription(EyeRotation, "vergence/eye_rotation", lambda m: self._take(convert.eye_rotation(m)))
        watch.create_subscription(PointStamped, "gaze/target", self._on_target)
        watch.create_subscription(CameraInfo, "left/camera_info", lambda m: self._on_camera(m, left=True))
        watch.create_subscription(CameraInfo, "right/camera_info", lambda m: self._on_camera(m, left=False))
        self.create_service(SetBool, "~/enable", self._on_enable)
        self.create_service(Trigger, "~/stop", self._on_stop)
        self._action = ActionServer(
            self,
            LookAt,
            "gaze/look_at",
            execute_callback=self._look_at,
            goal_callback=lambda request: GoalResponse.ACCEPT,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )
        self._timer = self.create_timer(1.0 / values.control_rate_hz, self._cycle)

    @property
    def resolution_rad(self) -> list[float]:
        """The smallest step of each joint [rad] that is reckoned with."""
        return [float(step) for step in self._controller.resolution_rad]

    def _now_s(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9

    def _take(self, observation: Observation) -> None:
        self._arrived.append(observation)

    def _on_target(self, message: PointStamped) -> None:
        stamp_s = to_seconds(message.header.stamp) or self._now_s()
        try:
            place = self._in_rig(message.point, message.header.frame_id, stamp_s)
        except FrameError as error:
            self.get_logger().warning(f"gaze/target: {error}", throttle_duration_sec=5.0)
            return
        self._take(PointSighting(stamp_s, place, math.nan))

    def _on_camera(self, message: CameraInfo, left: bool) -> None:
        try:
            model = convert.camera_model(message)
        except CameraModelError:
            return  # not calibrated: the rig's own figures stay
        if left:
            self._left = model
        else:
            self._right = model

    def _in_rig(self, point: Any, frame: str, stamp_s: float) -> tuple[float, float, float]:
        try:
            return self._controller.frame_to_rig((point.x, point.y, point.z), frame, stamp_s)
        except FrameError:
            if self._tf_buffer is None:
                raise
            return _transformed(self._tf_buffer, point, frame)

    def _cycle(self) -> None:
        now_s = self._now_s()
        for goal_id, (handle, _) in list(self._goals.items()):
            if handle.is_cancel_requested:
                self._controller.cancel(now_s, goal_id)
        arrived, self._arrived = self._arrived, []
        command = self._controller.step(now_s, arrived)
        self._newest = command
        self._cycles += 1
        if command.joints_rad is not None:
            self._command.publish(convert.joint_command(command.joints_rad, now_s))
        for outcome in command.outcomes:
            _, future = self._goals.get(outcome.goal_id, (None, None))
            if future is not None:
                future.set_result(outcome)
        self._publish(command, now_s)

    def _publish(self, command: Command, now_s: float) -> None:
        report = command.report
        self._state.publish(convert.gaze_state(report))
        if math.isfinite(report.fixation_m[0]):
            self._fixation.publish(convert.point_stamped(report.fixation_m, report.stamp_s))
        if self._cycles % _FEEDBACK_EVERY == 0:
            for goal_id, (handle, _) in self._goals.items():
                if goal_id == self._controller.goal_id:
                    handle.publish_feedback(convert.look_at_feedback(report))
        if self._cycles % _MARKERS_EVERY == 0 and self._markers.get_subscription_count():
            half = 0.5 * report.vergence_rad
            joints = np.array([report.version_rad - half, report.version_rad + half, report.tilt_rad])
            if np.isfinite(joints).all():
                self._markers.publish(convert.gaze_markers(joints, report.fixation_m, self._rig.baseline_m, now_s))

    async def _look_at(self, handle: ServerGoalHandle) -> LookAt.Result:
        now_s, request = self._now_s(), handle.request
        try:
            stamp_s = to_seconds(request.header.stamp) or math.nan
            is_point = request.kind == LookAt.Goal.POINT
            place = self._in_rig(request.point, request.header.frame_id, stamp_s) if is_point else (math.nan,) * 3
            goal = convert.goal(request, place, self._left, self._right)
        except ValueError as error:
            handle.abort()
            return convert.look_at_result(Outcome(0, Result.INVALID, str(error), 0.0), None, now_s)
        goal_id = self._controller.look_at(goal, now_s)
        future = Future()
        self._goals[goal_id] = (handle, future)
        try:
            outcome: Outcome = await future
        finally:
            del self._goals[goal_id]
        if outcome.result is Result.VERGED:
            handle.succeed()
        elif outcome.result is Result.CANCELLED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        self.get_logger().info(f"look_at: {outcome.result.name} after {outcome.time_s:.2f} s: {outcome.reason}")
        return convert.look_at_result(outcome, self._newest.report if self._newest else None, self._now_s())

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._controller.enable(request.data, self._now_s())
        response.success, response.message = True, "enabled" if request.data else "disabled: the eyes hold still"
        return response

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._controller.stop(self._now_s())
        response.success, response.message = True, "stopped: the eyes hold still"
        return response

    def _changed(self, parameters: ParameterSet) -> None:
        self._controller.set_parameters(parameters.value, self._now_s())

    def _gaze_health(self) -> Report:
        if self._newest is None or not math.isfinite(self._newest.report.tilt_rad):
            return Report(WARN, "no joint_states have arrived", {"cycles": self._cycles})
        report, encoder = self._newest.report, self._controller.vergence_offset
        values = {"law": report.law, "mode": report.mode, "verged": report.verged, "cycles": self._cycles}
        values |= {"eye_rotations_believed": encoder.believed, "eye_rotations_refused": encoder.refused}
        if encoder.refusal:
            values["eye_rotation_refused"] = encoder.refusal
        return Report(OK, f"{report.phase.name.lower()}: {report.reason}", values)


def _tf_buffer(node: Node) -> Any:
    """Return a tf2 buffer that listens, or None where tf2 is not installed."""
    try:
        from tf2_ros import Buffer, TransformListener
    except ImportError:
        return None
    buffer = Buffer()
    buffer.listener = TransformListener(buffer, node)
    return buffer


def _transformed(buffer: Any, point: Any, frame: str) -> tuple[float, float, float]:
    from rclpy.time import Time
    from tf2_ros import TransformException

    try:
        transform = buffer.lookup_transform(convert.BASE_FRAME, frame, Time()).transform
    except TransformException as error:
        raise FrameError(f"frame is {frame!r}: {error}") from error
    return convert.transformed_point(transform, point)


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run_node(GazeControllerNode, args)


if __name__ == "__main__":
    raise SystemExit(main())
