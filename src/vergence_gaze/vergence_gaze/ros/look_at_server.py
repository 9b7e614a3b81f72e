"""The action gaze/look_at: each goal runs in the controller until the control cycle reports its outcome."""

import math

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.task import Future

from vergence_common.stamps import to_seconds
from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import Command, GazeReport
from vergence_gaze.goals.goal import Outcome, Result
from vergence_gaze.ros import gaze_messages as convert
from vergence_gaze.ros.point_frames import PointFrames
from vergence_msgs.action import LookAt
from vergence_rig.camera import CameraModel


class LookAtServer:
    """Serves the action on a node; `cameras`, left and right, may be replaced at any time."""

    def __init__(
        self, node: Node, controller: GazeController, frames: PointFrames, cameras: tuple[CameraModel, CameraModel]
    ) -> None:
        self.cameras = cameras
        self._node, self._controller, self._frames = node, controller, frames
        self._goals: dict[int, tuple[ServerGoalHandle, Future]] = {}
        self._newest: GazeReport | None = None
        self._server = ActionServer(
            node,
            LookAt,
            "gaze/look_at",
            execute_callback=self._execute,
            goal_callback=lambda request: GoalResponse.ACCEPT,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )

    def forward_cancels(self, now_s: float) -> None:
        """Cancel the goals whose clients have asked for it."""
        for goal_id, (handle, _) in list(self._goals.items()):
            if handle.is_cancel_requested:
                self._controller.cancel(now_s, goal_id)

    def on_cycle(self, command: Command) -> None:
        """End the goals that have an outcome in this control cycle."""
        self._newest = command.report
        for outcome in command.outcomes:
            _, future = self._goals.get(outcome.goal_id, (None, None))
            if future is not None:
                future.set_result(outcome)

    def publish_feedback(self, report: GazeReport) -> None:
        """Publish the active goal's feedback."""
        for goal_id, (handle, _) in self._goals.items():
            if goal_id == self._controller.goal_id:
                handle.publish_feedback(convert.look_at_feedback(report))

    async def _execute(self, handle: ServerGoalHandle) -> LookAt.Result:
        now_s, request = self._now_s(), handle.request
        try:
            stamp_s = to_seconds(request.header.stamp) or math.nan
            is_point = request.kind == LookAt.Goal.POINT
            frame = request.header.frame_id
            place = self._frames.in_rig(request.point, frame, stamp_s) if is_point else (math.nan,) * 3
            goal = convert.goal(request, place, *self.cameras)
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
        self._node.get_logger().info(
            f"gaze/look_at: goal {goal_id} ended as {outcome.result.name} after {outcome.time_s:.2f} s: "
            f"{outcome.reason}"
        )
        return convert.look_at_result(outcome, self._newest, self._now_s())

    def _now_s(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9
