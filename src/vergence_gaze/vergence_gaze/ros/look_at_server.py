"""The action gaze/look_at, and gaze/goal, which says of every goal what was asked for and how it ended."""

import math
from typing import Any

from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from vergence_common.qos import QosWatch
from vergence_common.stamps import to_seconds
from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import GazeReport
from vergence_gaze.goals.goal import Goal, Outcome, Result
from vergence_gaze.goals.requested_class import check_class, with_detector
from vergence_gaze.ros import look_at_messages as convert
from vergence_gaze.ros.goal_reports import gaze_goal
from vergence_gaze.ros.goal_server import GoalServer
from vergence_gaze.ros.point_frames import PointFrames
from vergence_msgs.action import LookAt
from vergence_msgs.msg import GazeGoal
from vergence_rig.eye_image import EyeImage


class LookAtServer(GoalServer):
    """Serves the action on a node; `images`, left and right, may be replaced at any time.

    So may `classes`, those that the detector looks for; None while that is not known.
    """

    def __init__(
        self,
        node: Node,
        controller: GazeController,
        frames: PointFrames,
        images: tuple[EyeImage, EyeImage],
        watch: QosWatch,
    ) -> None:
        self.images = images
        self.classes: tuple[str, ...] | None = None
        self._frames = frames
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._reports = watch.create_publisher(GazeGoal, "gaze/goal", latched)
        super().__init__(node, controller, LookAt, "gaze/look_at")

    def _goal(self, request: Any) -> Goal:
        stamp_s = to_seconds(request.header.stamp) or math.nan
        is_point = request.kind == LookAt.Goal.POINT
        frame = request.header.frame_id
        place = self._frames.in_rig(request.point, frame, stamp_s) if is_point else (math.nan,) * 3
        goal = convert.goal(request, place, *self.images)
        check_class(goal, self.classes)
        return goal

    def _feedback(self, request: Any, report: GazeReport) -> LookAt.Feedback:
        return convert.look_at_feedback(report)

    def _result(self, outcome: Outcome, report: GazeReport | None) -> LookAt.Result:
        known = None if outcome.result is Result.INVALID else report
        return convert.look_at_result(outcome, known, self._now_s())

    def _on_rejected(self, request: Any, result: Result, reason: str) -> None:
        super()._on_rejected(request, result, reason)
        outcome = Outcome(0, result, reason, 0.0)
        self._reports.publish(gaze_goal(request, GazeGoal.REJECTED, self._now_s(), outcome))

    def _on_started(self, handle: ServerGoalHandle) -> None:
        self._publish(handle, GazeGoal.ACTIVE)

    def _on_ended(self, handle: ServerGoalHandle, outcome: Outcome) -> None:
        super()._on_ended(handle, outcome)
        self._publish(handle, GazeGoal.ENDED, outcome)

    def _ending(self, request: Any, outcome: Outcome) -> Outcome:
        return (
            with_detector(outcome, request.class_name, self.classes) if request.kind == LookAt.Goal.CLASS else outcome
        )

    def _publish(self, handle: ServerGoalHandle, state: int, outcome: Outcome | None = None) -> None:
        message = gaze_goal(handle.request, state, self._now_s(), outcome)
        message.uuid = handle.goal_id.uuid
        self._reports.publish(message)
