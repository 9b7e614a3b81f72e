"""Requests of goals and results whose answers are lost on the way, against an action server of the test's own."""

from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse

from vergence_common import goal_requests
from vergence_common.goal_requests import request_goal, request_result
from vergence_msgs.action import LookAt

from .conftest import Graph

pytestmark = pytest.mark.graph


class Losing:
    """Stands before the middleware's side of an action server: the first `count` calls of `name` send nothing."""

    def __init__(self, handle: Any, name: str, count: int) -> None:
        self._handle, self._name, self.left = handle, name, count

    def __enter__(self) -> Any:
        return self._handle.__enter__()

    def __exit__(self, *error: object) -> None:
        self._handle.__exit__(*error)

    def __getattr__(self, name: str) -> Any:
        if name != self._name:
            return getattr(self._handle, name)
        if self.left > 0:
            self.left -= 1
            return lambda *_: None
        return getattr(self._handle, name)


class Server:
    """An action server that loses answers, with what it did."""

    def __init__(self, graph: Graph, loses: str = "", count: int = 0, accepts: bool = True, runs: bool = True) -> None:
        self.goals = 0
        self.cancelled = False
        self.server = ActionServer(
            graph.client,
            LookAt,
            "gaze/look_at",
            self._execute,
            goal_callback=lambda _: GoalResponse.ACCEPT if accepts else GoalResponse.REJECT,
            handle_accepted_callback=lambda handle: handle.execute() if runs else None,
            cancel_callback=self._cancel,
        )
        self.losing = self.server._handle = Losing(self.server._handle, loses, count)

    def _execute(self, handle: Any) -> LookAt.Result:
        self.goals += 1
        handle.succeed()
        return LookAt.Result(result=LookAt.Result.VERGED)

    def _cancel(self, handle: Any) -> CancelResponse:
        self.cancelled = True
        return CancelResponse.REJECT


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(goal_requests, "AGAIN_S", 0.05)


@pytest.fixture
def client(graph: Graph) -> ActionClient:
    return ActionClient(graph.client, LookAt, "gaze/look_at")


@pytest.mark.parametrize("loses", ["", "send_goal_response", "send_result_response"])
@pytest.mark.parametrize("count", [1, 3])
def test_a_goal_whose_answers_are_lost_is_done_once(graph: Graph, client: ActionClient, loses: str, count: int) -> None:
    server = Server(graph, loses, count)
    graph.wait_until(client.server_is_ready, "the server")
    handle = graph.wait(request_goal(graph.client, client, LookAt.Goal()))
    assert handle.accepted
    answer = graph.wait(request_result(graph.client, handle))
    assert (answer.status, answer.result.result) == (GoalStatus.STATUS_SUCCEEDED, LookAt.Result.VERGED)
    assert server.goals == 1
    assert not loses or server.losing.left == 0


def test_a_rejected_goal_is_not_accepted(graph: Graph, client: ActionClient) -> None:
    Server(graph, accepts=False)
    graph.wait_until(client.server_is_ready, "the server")
    assert not graph.wait(request_goal(graph.client, client, LookAt.Goal())).accepted


def test_a_goal_whose_rejection_is_lost_is_unknown(graph: Graph, client: ActionClient) -> None:
    Server(graph, "send_goal_response", 1, accepts=False)
    graph.wait_until(client.server_is_ready, "the server")
    handle = graph.wait(request_goal(graph.client, client, LookAt.Goal()))
    assert graph.wait(request_result(graph.client, handle)).status == GoalStatus.STATUS_UNKNOWN


def test_a_goal_that_is_given_up_is_cancelled_once_it_is_accepted(graph: Graph, client: ActionClient) -> None:
    server = Server(graph, runs=False)
    graph.wait_until(client.server_is_ready, "the server")
    request_goal(graph.client, client, LookAt.Goal()).cancel()
    graph.wait_until(lambda: server.cancelled, "the cancellation")
