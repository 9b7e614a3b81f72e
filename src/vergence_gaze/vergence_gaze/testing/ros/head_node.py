"""The fake head as a node: on the topics of sim_node and of the metric nodes, with a clock of its own."""

import math

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from vergence_common.stamps import to_stamp
from vergence_gaze.estimation.observations import BoxSighting, EdgeContrast, JointReport, TrackSighting
from vergence_gaze.goals.goal import ObjectRequest
from vergence_gaze.testing.fake_head import FakeHead
from vergence_msgs.msg import BoxVergence, DetectedObject, EdgeVergence, GazeState, TargetTrack, TrackRequest
from vergence_msgs.msg import ObjectRequest as ObjectRequestMessage
from vergence_rig.rig import JOINT_NAMES

FOCAL_PX = 539.0
_BEGIN_S = 1000.0
_TURN_TICKS = 3
_LONGEST_CYCLE_S = 0.045


class HeadNode(Node):
    """The fake head on the topics of sim_node, edge_metric_node and box_metric_node, and the clock of all nodes.

    Time goes on by 10 ms, but never further than the controller's cycle can have followed.
    """

    def __init__(self, head: FakeHead, context: Context) -> None:
        super().__init__("head", context=context)
        self.head = head
        self._answered_s = 0.0
        self.silent: set[str] = set()
        """Of "joints" and "images", what is not published."""
        self.images_fault = ""
        """If set, why tracks say that the images are unusable."""
        self._time = self.create_publisher(Clock, "/clock", 10)
        self._joints = self.create_publisher(JointState, "joint_states", 10)
        self._edge = self.create_publisher(EdgeVergence, "vergence/edge", 10)
        self._track = self.create_publisher(TargetTrack, "vergence/track", 10)
        self._box = self.create_publisher(BoxVergence, "vergence/box", 10)
        self.commands: list[list[float]] = []
        self.create_subscription(JointState, "joint_command", self._on_command, 10)
        self.create_subscription(GazeState, "gaze/state", self._on_state, 10)
        self.create_subscription(TrackRequest, "vergence/track_request", self._on_request, 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.object_requests: list[ObjectRequest] = []
        self.create_subscription(ObjectRequestMessage, "vergence/object_request", self._on_object_request, latched)
        self.create_timer(0.001, self._turn)

    @property
    def now(self) -> Time:
        """The present, as a stamp."""
        return self._stamp(self.head.time_s)

    def _on_command(self, message: JointState) -> None:
        by_name = dict(zip(message.name, message.position, strict=True))
        self.commands.append([by_name[name] for name in JOINT_NAMES])
        self.head.command(np.array(self.commands[-1]))

    def _on_request(self, message: TrackRequest) -> None:
        self.head.track_for(message.goal_id)

    def _on_object_request(self, message: ObjectRequestMessage) -> None:
        self.object_requests.append(ObjectRequest(message.class_name, message.object_id))
        self.head.wanted = self.object_requests[-1]

    def _on_state(self, message: GazeState) -> None:
        self._answered_s = self.head.time_s

    def _turn(self) -> None:
        if self.head.time_s - self._answered_s < _LONGEST_CYCLE_S:
            for _ in range(_TURN_TICKS):
                for observation in self.head.advance():
                    self._publish(observation)
        # Again while waiting: a node that joins late has no other time.
        self._time.publish(Clock(clock=self.now))

    def _stamp(self, head_s: float) -> Time:
        return to_stamp(_BEGIN_S + head_s)

    def _publish(self, seen: object) -> None:
        if ("joints" if isinstance(seen, JointReport) else "images") in self.silent:
            return
        if isinstance(seen, JointReport):
            message = JointState(name=list(seen.positions_rad), position=list(seen.positions_rad.values()))
            message.header.stamp = self._stamp(seen.stamp_s)
            self._joints.publish(message)
        elif isinstance(seen, EdgeContrast):
            edge = EdgeVergence(windows_px=[50, 300], contrast=[seen.contrast, 1.0])
            edge.left_to_right_px = edge.right_to_left_px = [seen.metric_px, 9.0]
            edge.header.stamp = self._stamp(seen.stamp_s)
            self._edge.publish(edge)
        elif isinstance(seen, TrackSighting):
            track = TargetTrack(
                pair_skew_s=seen.skew_s,
                track_id=seen.track_id,
                goal_id=seen.goal_id,
                left_x_px=319.5 + FOCAL_PX * seen.left_x,
                left_y_px=239.5 + FOCAL_PX * seen.left_y,
                disparity_rad=seen.disparity_rad,
                sigma_px=seen.sigma_rad * FOCAL_PX,
                status=TargetTrack.STATUS_OK if seen.usable else TargetTrack.STATUS_LOST,
            )
            track.header.stamp = self._stamp(seen.stamp_s)
            if self.images_fault:
                track.status, track.reason = TargetTrack.STATUS_UNUSABLE_IMAGES, self.images_fault
            self._track.publish(track)
        elif isinstance(seen, BoxSighting):
            box = BoxVergence(
                pair_skew_s=seen.skew_s,
                left_azimuth_rad=seen.left_azimuth_rad,
                left_elevation_rad=seen.left_elevation_rad,
                right_azimuth_rad=seen.right_azimuth_rad,
                right_elevation_rad=seen.right_elevation_rad,
                refined_horizontal_px=FOCAL_PX * math.tan(seen.surface_disparity_rad),
                sigma_px=FOCAL_PX * seen.sigma_rad,
                refined_sigma_px=FOCAL_PX * seen.surface_sigma_rad,
                class_name=seen.class_name,
                status=BoxVergence.STATUS_OK if seen.usable else BoxVergence.STATUS_NO_TARGET,
                object_id=seen.object_id,
                objects=[DetectedObject(object_id=one.object_id, class_name=one.class_name) for one in seen.objects],
            )
            box.left.x_max_px, box.left.y_max_px = FOCAL_PX * seen.extent_rad, FOCAL_PX * seen.extent_height_rad
            box.header.stamp = self._stamp(seen.stamp_s)
            self._box.publish(box)
