"""gaze_controller_node: turns the eyes by the metric nodes' measurements, and serves gaze/look_at."""

import math
from time import monotonic
from typing import Any

import numpy as np
from geometry_msgs.msg import PointStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo, JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from vergence_common.camera_infos import CameraInfoInput
from vergence_common.diagnostics import ERROR, OK, WARN, Diagnostics, Report
from vergence_common.joint_states import JointStateInput
from vergence_common.node_main import run_node
from vergence_common.parameters import ParameterSet, declare
from vergence_common.qos import watch_qos
from vergence_common.stamps import to_seconds
from vergence_common.two_rates import TwoRates
from vergence_gaze.attention_parameters import POLICIES
from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import Command
from vergence_gaze.estimation.observations import Observation, PointSighting
from vergence_gaze.joints.frames import FrameError
from vergence_gaze.parameter_groups import collected, gaze_groups
from vergence_gaze.parameters import GazeNodeParameters, GazeParameters
from vergence_gaze.ros import gaze_messages as convert
from vergence_gaze.ros.goal_server import GoalServer
from vergence_gaze.ros.joint_command import JointCommandOutput
from vergence_gaze.ros.look_at_server import LookAtServer
from vergence_gaze.ros.point_frames import PointFrames
from vergence_gaze.ros.point_head_server import make_point_head_server
from vergence_gaze.ros.vision_input import VisionInput
from vergence_msgs.msg import DetectorClasses, GazeState, ObjectRequest, TrackRequest
from vergence_rig.camera import CameraModel, CameraModelError
from vergence_rig.eye_image import described_camera, eye_images
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig_file import load_rig

_FEEDBACK_EVERY = 10
_MARKERS_EVERY = 10
_CAMERAS_EVERY = 10
_RESTING_PERIOD_S = 0.1  # of cycles, while nothing is commanded and nothing reads the reports


class GazeControllerNode(Node):
    """GazeController on topics: messages in, a control timer, messages out."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("gaze_controller_node", **node_options)
        settings = declare(self, gaze_groups())
        values = settings.get(GazeNodeParameters)
        self._rig = load_rig(values.rig)
        self._kinematics = Kinematics(self._rig)
        self._cameras = [CameraModel(self._rig.camera(left)) for left in (True, False)]
        self._images = eye_images(self._rig, (self._cameras[0], self._cameras[1]))
        self._controller = GazeController(self._rig, _parameters(settings), 1.0 / values.control_rate_hz)
        settings.on_change(self._on_parameters)
        self._arrived: list[Observation] = []
        self._newest: Command | None = None
        self._cycles = 0
        self._frames = PointFrames(self, self._controller)

        diagnostics = Diagnostics(self)
        diagnostics.add("gaze", self._report)
        watch = watch_qos(self, diagnostics)
        self._look_at = LookAtServer(self, self._controller, self._frames, self._images, watch)
        self._servers: list[GoalServer] = [self._look_at]
        point_head = make_point_head_server(self, self._controller, self._frames)
        if point_head is not None:
            self._servers.append(point_head)
        for server in self._servers:
            server.on_request = self._on_request
        self._command = JointCommandOutput(watch.create_publisher(JointState, "joint_command"))
        self._track_requests = watch.create_publisher(TrackRequest, "vergence/track_request")
        # Latched: what holds until the next message, for nodes that start later.
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._object_requests = watch.create_publisher(ObjectRequest, "vergence/object_request", latched)
        read = self._update_readers
        self._read = (False, False, False)
        self._state = watch.create_publisher(GazeState, "gaze/state", matched=read)
        self._fixation = watch.create_publisher(PointStamped, "gaze/fixation_point", matched=read)
        self._markers = watch.create_publisher(MarkerArray, "gaze/markers", QoSProfile(depth=1), matched=read)
        self._joint_input = JointStateInput(
            self, diagnostics, watch, lambda j: self._add(convert.joint_report(j)), polled=True
        )
        watch.create_subscription(
            JointState, "servo_node/resolution", lambda m: self._add(convert.joint_resolution(m)), latched
        )
        self._vision = VisionInput(self, watch, self._add, lambda: self._images[0])
        watch.create_subscription(DetectorClasses, "vergence/detector_classes", self._on_classes, latched)
        watch.create_subscription(PointStamped, "gaze/target", self._on_target)
        watch.create_subscription(String, "gaze/attention", self._on_attention)
        self._camera_infos = [
            CameraInfoInput(self, watch, "left/camera_info", lambda m: self._on_camera(m, left=True)),
            CameraInfoInput(self, watch, "right/camera_info", lambda m: self._on_camera(m, left=False)),
        ]
        self.create_service(SetBool, "~/enable", self._on_enable)
        self.create_service(Trigger, "~/stop", self._on_stop)
        period_s = 1.0 / values.control_rate_hz
        self._cycle_timer = TwoRates(self, self._cycle, period_s, max(period_s, _RESTING_PERIOD_S))

    def destroy_node(self) -> None:
        """Destroy the subscriptions and action servers, too, which rclpy's node does not."""
        self._joint_input.close()
        self._vision.close()
        for info in self._camera_infos:
            info.close()
        for server in self._servers:
            server.destroy()
        super().destroy_node()

    @property
    def resolution_rad(self) -> list[float]:
        """The smallest step of each joint [rad] in the controller's model of the servos."""
        return [float(step) for step in self._controller.resolution_rad]

    def _now_s(self) -> float:
        return self.get_clock().now().nanoseconds * 1e-9

    def _add(self, observation: Observation) -> None:
        self._arrived.append(observation)

    def _on_classes(self, message: DetectorClasses) -> None:
        self._look_at.classes = tuple(message.names)

    def _on_target(self, message: PointStamped) -> None:
        self._end_rest()
        stamp_s = to_seconds(message.header.stamp) or self._now_s()
        try:
            place = self._frames.in_rig(message.point, message.header.frame_id, stamp_s)
        except FrameError as error:
            self.get_logger().warning(f"a point on gaze/target was ignored: {error}", throttle_duration_sec=5.0)
            return
        self._add(PointSighting(stamp_s, place, math.nan))

    def _on_attention(self, message: String) -> None:
        if message.data in POLICIES:
            self._end_rest()
            self._controller.set_attention(message.data, self._now_s())
        else:
            allowed = ", ".join(POLICIES)
            self.get_logger().warning(
                f"a policy on gaze/attention was ignored: it must be one of {allowed}: got {message.data!r}"
            )

    def _on_camera(self, message: CameraInfo, left: bool) -> None:
        model: CameraModel | None
        try:
            model = convert.camera_model(message)
        except CameraModelError as error:
            if any(message.k):  # without them it is not calibrated, as the metric nodes report
                eye = "left" if left else "right"
                self.get_logger().warning(f"{eye}/camera_info is refused, rig.yaml's description is used: {error}")
            model = described_camera(self._rig.camera(left), message.width, message.height)
        if model is not None:
            self._cameras[0 if left else 1] = model
            self._images = self._look_at.images = eye_images(self._rig, (self._cameras[0], self._cameras[1]))

    def _update_readers(self, _: object = None) -> None:
        """Record which reports have subscribers: to ask in every cycle would cost as much as publishing."""
        self._read = tuple(p.get_subscription_count() > 0 for p in (self._state, self._fixation, self._markers))
        if any(self._read):
            self._end_rest()

    def _on_request(self) -> None:
        self._read_cameras()
        self._end_rest()

    def _read_cameras(self) -> None:
        for info in self._camera_infos:
            info.poll()

    def _end_rest(self) -> None:
        """Go on at the full rate, with what has arrived: something is requested or read."""
        if self._cycle_timer.set_fast(True):
            self._controller.observe(self._pop_arrived(), self._now_s())

    def _pop_arrived(self) -> list[Observation]:
        """Return what has arrived since the last time: the joints' reports before what the eyes saw at them."""
        self._joint_input.poll()
        self._vision.poll()
        arrived, self._arrived = self._arrived, []
        return arrived

    def _cycle(self) -> None:
        now_s = self._cycle_timer.called_ns * 1e-9
        arrived = self._pop_arrived()
        if self._cycles % _CAMERAS_EVERY == 0:
            self._read_cameras()
        self._cycles += 1
        self._cycle_timer.set_fast(not self._controller.rests(now_s) or any(self._read))
        for server in self._servers:
            server.forward_cancels(now_s)
        self._vision.update(self._controller.uses_images, monotonic())
        command = self._controller.step(now_s, arrived, self._joint_input.problem())
        self._newest = command
        for server in self._servers:
            server.on_cycle(command)
        self._publish(command, now_s)

    def _publish(self, command: Command, now_s: float) -> None:
        state_read, fixation_read, markers_read = self._read
        self._command.update(command.joints_rad, now_s)
        if command.track_request is not None:
            self._read_cameras()
            self._track_requests.publish(convert.track_request(command.track_request, self._images))
        if command.object_request is not None:
            self._object_requests.publish(convert.object_request(command.object_request, now_s))
        if state_read:
            self._state.publish(convert.gaze_state(command.report, now_s))
        if fixation_read and math.isfinite(command.report.fixation_m[0]):
            self._fixation.publish(convert.point_stamped(command.report.fixation_m, command.report.stamp_s))
        if self._cycles % _FEEDBACK_EVERY == 0:
            for server in self._servers:
                server.publish_feedback(command)
        if markers_read and self._cycles % _MARKERS_EVERY == 0:
            report = command.report
            half = 0.5 * report.vergence_rad
            angles = np.array([report.version_rad - half, report.version_rad + half, report.tilt_rad])
            if np.isfinite(angles).all():
                self._markers.publish(convert.gaze_markers(angles, report.fixation_m, self._kinematics, now_s))

    def _on_enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._end_rest()
        self._controller.enable(request.data, self._now_s())
        response.success, response.message = True, "enabled" if request.data else "disabled: the eyes hold still"
        return response

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._end_rest()
        self._controller.stop(self._now_s())
        response.success, response.message = True, "stopped: the eyes hold still"
        return response

    def _on_parameters(self, settings: ParameterSet) -> None:
        self._controller.set_parameters(_parameters(settings), self._now_s())

    def _report(self) -> Report:
        self._update_readers()  # not every middleware reports matches
        if self._newest is None:
            return Report(WARN, "no control cycle yet")
        report, encoder = self._newest.report, self._controller.vergence_offset
        if not math.isfinite(report.tilt_rad):
            level = ERROR if self._joint_input.reader.received else WARN
            return Report(level, report.reason, {"cycles": self._cycles})
        values = {"law": report.law, "mode": report.mode, "verged": report.verged, "cycles": self._cycles}
        values |= {"eye_rotations_accepted": encoder.accepted, "eye_rotations_rejected": encoder.rejected}
        values |= self._controller.mounts.summary()
        if encoder.rejection:
            values["eye_rotation_rejection"] = encoder.rejection
        if report.fault:
            return Report(ERROR, report.reason, values)
        if report.images_missing:
            return Report(WARN, f"no results from the images arrive: {report.reason}", values)
        if moved := self._controller.mounts.request:
            return Report(WARN, moved, values)
        return Report(OK, f"{report.phase.name.lower()}: {report.reason}", values)


def _parameters(settings: ParameterSet) -> GazeParameters:
    return collected(settings.get(kind) for _, kind in gaze_groups())


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run_node(GazeControllerNode, args, gaze_groups())


if __name__ == "__main__":
    raise SystemExit(main())
