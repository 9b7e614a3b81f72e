"""Requests of an action's goals and results, made again until they are answered.

A client sees a server before the server sees the client, and what the server answers meanwhile is lost. Call these in
the thread of the node's executor: rclpy drops an answer that comes before the thread that sends has noted the request.
"""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

AGAIN_S = 1.0
"""Time without an answer after which something is requested again the first time; it doubles each time."""


def request_goal(
    node: Node, client: ActionClient, goal: Any, on_feedback: Callable[[Any], None] | None = None
) -> Future:
    """Request a goal, with the same id until the server answers, so that it is done once.

    The server refuses an id that it has. A refusal of what was requested again therefore says nothing: the goal counts
    as accepted then, and the answer to `request_result` says whether the server has it (STATUS_UNKNOWN if not).

    Args:
        node: that of the client.
        client: of the action; its server must be there.
        goal: the action's goal.
        on_feedback: called with every feedback message of the goal.

    Returns:
        A future of the goal's ClientGoalHandle. Once it is cancelled, nothing is requested, and a goal that is accepted
        later is cancelled.
    """
    own_id = UUID(uuid=np.frombuffer(np.random.default_rng().bytes(16), np.uint8))

    def send() -> Future:
        sent = client.send_goal_async(goal, feedback_callback=on_feedback, goal_uuid=own_id)
        sent.add_done_callback(cancel_if_late)
        return sent

    def cancel_if_late(sent: Future) -> None:
        if request.answered.cancelled() and sent.result().accepted:
            sent.result().cancel_goal_async()

    def handle_of(handle: ClientGoalHandle, count: int) -> ClientGoalHandle:
        if handle.accepted or count == 1:
            return handle
        return ClientGoalHandle(client, own_id, SimpleNamespace(accepted=True, stamp=handle.stamp))

    request = _Repeated(node, send, handle_of)
    return request.answered


def request_result(node: Node, handle: ClientGoalHandle) -> Future:
    """Return a future of the result of an accepted goal, with its status; it is requested until the server answers."""
    return _Repeated(node, handle.get_result_async, lambda answer, _: answer).answered


class _Repeated:
    """Sends until one of the requests is answered, or `answered` cancelled."""

    def __init__(self, node: Node, send: Callable[[], Future], value: Callable[[Any, int], Any]) -> None:
        self._node, self._send, self._value = node, send, value
        self._count, self._wait_s = 0, AGAIN_S
        self._timer: Any = None
        self.answered = Future(executor=node.executor)
        self.answered.add_done_callback(lambda _: self._stop())
        self._next()

    @property
    def ended(self) -> bool:
        """Whether nothing is requested any more; a cancelled future is not `done` in rclpy."""
        return bool(self.answered.done() or self.answered.cancelled())

    def _next(self) -> None:
        self._stop()
        if self.ended:
            return
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self._node.create_timer(self._wait_s, self._next, clock=steady)
        self._count, self._wait_s = self._count + 1, 2.0 * self._wait_s
        self._send().add_done_callback(self._on_answer)

    def _stop(self) -> None:
        if self._timer is not None:
            self._node.destroy_timer(self._timer)
            self._timer = None

    def _on_answer(self, sent: Future) -> None:
        if not self.ended:
            self.answered.set_result(self._value(sent.result(), self._count))
