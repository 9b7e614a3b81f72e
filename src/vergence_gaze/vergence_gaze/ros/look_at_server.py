"""The action gaze/look_at: each goal runs in the controller until the control cycle reports its outcome."""

import math
from collections.abc import Callable

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from vergence_common.stamps import to_seconds
from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import Command, GazeReport
from vergence_gaze.goals.goal import Outcome, Result
from vergence_gaze.goals.requested_class import check_class, with_detector
from vergence_gaze.ros import gaze_messages as convert
from vergence_gaze.ros.point_frames import PointFrames
from vergence_msgs.action import LookAt
from vergence_rig.eye_image import EyeImage


class LookAtServer:
    """Serves the action on a node; `images`, left and right, may be replaced at any time.

    So may `classes`, those that the detector looks for; None while that is not known.
    """

    def __init__(
        self,
        node: Node,
        controller: GazeController,
        frames: PointFrames,
        images: tuple[EyeImage, EyeImage],
        on_goal: Callable[[], None],
    ) -> None:
        self._on_goal = on_goal
        self.images = images
        self.classes: tuple[str, ...] | None = None
        self._node, self._controller, self._frames = node, controller, frames
        self._goals: dict[int, ServerGoalHandle] = {}
        self._outcomes: dict[bytes, Outcome] = {}
        self._newest: GazeReport | None = None
        self._server = ActionServer(
            node,
            LookAt,
            "gaze/look_at",
            execute_callback=self._execute,
            goal_callback=lambda request: GoalResponse.ACCEPT,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )

    def forward_cancels(self, now_s: float) -> None:
        """Cancel the goals whose clients have asked for it."""
        for goal_id, handle in list(self._goals.items()):
            if handle.is_cancel_requested:
                self._controller.cancel(now_s, goal_id)

    def on_cycle(self, command: Command) -> None:
        """End the goals that have an outcome in this control cycle."""
        self._newest = command.report
        for outcome in command.outcomes:
            handle = self._goals.pop(outcome.goal_id, None)
            if handle is not None:
                self._end(handle, outcome)

    def publish_feedback(self, report: GazeReport) -> None:
        """Publish the active goal's feedback."""
        for goal_id, handle in self._goals.items():
            if goal_id == self._controller.goal_id:
                handle.publish_feedback(convert.look_at_feedback(report))

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        # The goal is executed once it has ended: rclpy's events executor calls a coroutine that awaits without pause.
        self._on_goal()
        now_s, request = self._now_s(), handle.request
        try:
            stamp_s = to_seconds(request.header.stamp) or math.nan
            is_point = request.kind == LookAt.Goal.POINT
            frame = request.header.frame_id
            place = self._frames.in_rig(request.point, frame, stamp_s) if is_point else (math.nan,) * 3
            goal = convert.goal(request, place, *self.images)
            check_class(goal, self.classes)
        except ValueError as error:
            self._end(handle, Outcome(0, Result.INVALID, str(error), 0.0))
            return
        self._goals[self._controller.look_at(goal, now_s)] = handle

    def _end(self, handle: ServerGoalHandle, outcome: Outcome) -> None:
        self._outcomes[bytes(handle.goal_id.uuid)] = outcome
        handle.execute()

    def _execute(self, handle: ServerGoalHandle) -> LookAt.Result:
        """Return the result of a goal that has ended."""
        outcome, request = self._outcomes.pop(bytes(handle.goal_id.uuid)), handle.request
        if request.kind == LookAt.Goal.CLASS:
            outcome = with_detector(outcome, request.class_name, self.classes)
        if outcome.result is Result.INVALID:
            handle.abort()
            return convert.look_at_result(outcome, None, self._now_s())
        if outcome.result is Result.VERGED:
            handle.succeed()
        elif outcome.result is Result.CANCELLED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        self._node.get_logger().info(
            f"gaze/look_at: goal {outcome.goal_id} ended as {outcome.result.name} after {outcome.time_s:.2f} s: "
            f"{outcome.reason}"
        )
        return convert.look_at_result(outcome, self._newest, self._now_s())

    def _now_s(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9
