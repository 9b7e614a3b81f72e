"""What the actions of the controller share: each goal runs in the controller until a control cycle reports its end."""

from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node

from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import Command, GazeReport
from vergence_gaze.goals.goal import Goal, GoalError, Outcome, Result


class GoalServer:
    """Serves one action. A goal that can never succeed is rejected at once; `_on_rejected` says why.

    Subclasses turn requests into goals of the controller, and outcomes and reports into results and feedback.
    """

    def __init__(self, node: Node, controller: GazeController, action: Any, name: str) -> None:
        self._node, self._controller, self._name = node, controller, name
        self.on_request: Callable[[], None] = lambda: None
        """Called before a request is looked at."""
        self._goals: dict[int, ServerGoalHandle] = {}
        self._outcomes: dict[bytes, tuple[Outcome, GazeReport | None]] = {}
        self._server = ActionServer(
            node,
            action,
            name,
            execute_callback=self._execute,
            goal_callback=self._on_request,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )

    def destroy(self) -> None:
        """Destroy the action's server: its node does not when it is destroyed."""
        self._server.destroy()

    def forward_cancels(self, now_s: float) -> None:
        """Cancel the goals whose clients have asked for it."""
        for goal_id, handle in list(self._goals.items()):
            if handle.is_cancel_requested:
                self._controller.cancel(now_s, goal_id)

    def on_cycle(self, command: Command) -> None:
        """End the goals that have an outcome in this control cycle."""
        for outcome in command.outcomes:
            handle = self._goals.pop(outcome.goal_id, None)
            if handle is not None:
                self._end(handle, outcome, command.report)

    def publish_feedback(self, command: Command) -> None:
        """Publish the active goal's feedback."""
        for goal_id, handle in self._goals.items():
            if goal_id == self._controller.goal_id:
                handle.publish_feedback(self._feedback(handle.request, command.report))

    def _goal(self, request: Any) -> Goal:
        """Return a request as the controller's goal; raises ValueError for one that cannot be."""
        raise NotImplementedError

    def _feedback(self, request: Any, report: GazeReport) -> Any:
        """Return the action's feedback."""
        raise NotImplementedError

    def _result(self, outcome: Outcome, report: GazeReport | None) -> Any:
        """Return the action's result."""
        raise NotImplementedError

    def _succeeded(self, result: Result) -> bool:
        """Return whether a result is the action's success."""
        return result is Result.VERGED

    def _ending(self, request: Any, outcome: Outcome) -> Outcome:
        """Return an outcome as it is reported."""
        return outcome

    def _on_rejected(self, request: Any, result: Result, reason: str) -> None:
        self._node.get_logger().warning(f"{self._name}: goal rejected as {result.name}: {reason}")

    def _on_started(self, handle: ServerGoalHandle) -> None:
        """Note that a goal was accepted."""

    def _on_ended(self, handle: ServerGoalHandle, outcome: Outcome) -> None:
        self._node.get_logger().info(
            f"{self._name}: goal {outcome.goal_id} ended as {outcome.result.name} after {outcome.time_s:.2f} s: "
            f"{outcome.reason}"
        )

    def _on_request(self, request: Any) -> GoalResponse:
        self.on_request()
        try:
            self._controller.check(self._goal(request), self._now_s())
        except ValueError as error:
            result = error.result if isinstance(error, GoalError) else Result.INVALID
            self._on_rejected(request, result, str(error))
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        # The goal is executed once it has ended: rclpy's events executor calls a coroutine that awaits without pause.
        self._on_started(handle)
        try:
            goal = self._goal(handle.request)
        except ValueError as error:  # what it was checked with has changed meanwhile
            self._end(handle, Outcome(0, Result.INVALID, str(error), 0.0), None)
            return
        self._goals[self._controller.look_at(goal, self._now_s())] = handle

    def _end(self, handle: ServerGoalHandle, outcome: Outcome, report: GazeReport | None) -> None:
        self._outcomes[bytes(handle.goal_id.uuid)] = outcome, report
        handle.execute()

    def _execute(self, handle: ServerGoalHandle) -> Any:
        """Return the result of a goal that has ended."""
        ended, report = self._outcomes.pop(bytes(handle.goal_id.uuid))
        outcome = self._ending(handle.request, ended)
        if self._succeeded(outcome.result):
            handle.succeed()
        elif outcome.result is Result.CANCELLED and handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        self._on_ended(handle, outcome)
        return self._result(outcome, report)

    def _now_s(self) -> float:
        return self._node.get_clock().now().nanoseconds * 1e-9
