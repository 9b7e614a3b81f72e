"""`vergence look` as a process, against an action server of the test's own."""

import math
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future

from vergence_msgs.action import LookAt
from vergence_msgs.msg import GazeGoal, GazeState

from .conftest import Graph

pytestmark = pytest.mark.graph


class Controller:
    """Serves gaze/look_at: every goal ends as `result`, or goes on until it is cancelled where that is None."""

    def __init__(self, node: Node, result: int | None) -> None:
        self._result = result
        self.goals: list[LookAt.Goal] = []
        self.cancelled = Future()
        self.server = ActionServer(
            node, LookAt, "gaze/look_at", self._execute, cancel_callback=lambda handle: self._cancel()
        )

    def _cancel(self) -> CancelResponse:
        self.cancelled.set_result(True)
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> LookAt.Result:
        self.goals.append(handle.request)
        handle.publish_feedback(LookAt.Feedback(phase_name="saccade", version_residual_deg=5.0))
        if self._result is None:
            await self.cancelled
            handle.canceled()
            return LookAt.Result(result=LookAt.Result.CANCELLED)
        handle.succeed() if self._result == LookAt.Result.VERGED else handle.abort()
        result = LookAt.Result(result=self._result, reason="three distances fit", time_s=0.5)
        result.fixation_point.point.x = 0.75
        return result


def look(*words: str) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "vergence_bringup.command_line", "look", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(graph: Graph, process: "subprocess.Popen[str]") -> tuple[int, str, str]:
    try:
        graph.wait_until(lambda: process.poll() is not None, "vergence look ends")
    finally:
        process.kill()
        out, err = process.communicate()
    return process.returncode, out, err


@pytest.mark.parametrize(
    ("result", "status", "word"),
    [
        (LookAt.Result.VERGED, 0, "VERGED"),
        (LookAt.Result.AMBIGUOUS, 1, "AMBIGUOUS"),
        (LookAt.Result.AT_POINT, 1, "AT_"),
    ],
)
def test_the_exit_status_says_whether_it_verged(graph: Graph, result: int, status: int, word: str) -> None:
    controller = Controller(graph.client, result)
    code, out, err = ended(graph, look("--pixel", "412", "230"))
    assert (code, err) == (status, "")
    assert "pixel (412, 230) of the left eye" in out
    assert "saccade  to turn: version +5.00" in out
    assert word in out
    assert "three distances fit" in out
    assert "(0.750, 0.000, 0.000) m" in out
    (goal,) = controller.goals
    assert (goal.kind, goal.eye, goal.left_x_px, goal.left_y_px) == (LookAt.Goal.PIXEL, 0, 412.0, 230.0)


def test_the_targets_distance_is_printed_with_its_interval(graph: Graph) -> None:
    Controller(graph.client, LookAt.Result.VERGED)
    states = graph.client.create_publisher(GazeState, "gaze/state", 10)
    state = GazeState(distance_m=72.0, distance_low_m=1.25, distance_high_m=math.inf)
    graph.client.create_timer(0.02, lambda: states.publish(state))
    code, out, err = ended(graph, look("--pixel", "412", "230"))
    assert (code, err) == (0, "")
    assert out.splitlines()[-1].endswith("72.00 m (1.25 to inf m)")


def test_a_point_in_a_frame_and_a_namespace(graph: Graph) -> None:
    controller = Controller(graph.add(Node("controller", namespace="head", context=graph.context)), 0)
    words = ("--point", "0.6", "0.1", "0", "--frame", "left_camera_optical_frame", "--namespace", "head")
    assert ended(graph, look(*words, "--time-limit", "4"))[0] == 0
    (goal,) = controller.goals
    assert (goal.kind, goal.point.x, goal.point.y) == (LookAt.Goal.POINT, 0.6, 0.1)
    assert (goal.header.frame_id, goal.time_limit_s) == ("left_camera_optical_frame", 4.0)


def test_a_rejected_goal_says_why(graph: Graph) -> None:
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    reports = graph.client.create_publisher(GazeGoal, "gaze/goal", latched)

    def reject(goal: LookAt.Goal) -> GoalResponse:
        reports.publish(GazeGoal(state=GazeGoal.REJECTED, kind=goal.kind, result=1, reason="of another goal"))
        report = GazeGoal(state=GazeGoal.REJECTED, kind=goal.kind, point=goal.point, result=1, reason="too far left")
        reports.publish(report)
        return GoalResponse.REJECT

    ActionServer(graph.client, LookAt, "gaze/look_at", lambda handle: LookAt.Result(), goal_callback=reject)
    code, out, err = ended(graph, look("--point", "0.1", "3", "0"))
    assert (code, err) == (1, "")
    assert out.splitlines()[-1] == "UNREACHABLE: too far left"


def test_ctrl_c_cancels_the_goal(graph: Graph) -> None:
    controller = Controller(graph.client, None)
    process = look("--class", "cube")
    graph.wait_until(lambda: bool(controller.goals), "the goal arrives")
    process.send_signal(signal.SIGINT)
    code, _, err = ended(graph, process)
    assert code == 130, err
    assert "the goal is cancelled" in err
    assert "Traceback" not in err
    assert controller.cancelled.done()


def test_without_a_controller_one_line_says_who_would_answer(graph: Graph) -> None:
    code, out, err = ended(graph, look("--pixel", "1", "2", "--wait", "0.5"))
    assert (code, out) == (1, "")
    (line,) = err.splitlines()
    assert "gaze_controller_node" in line


def test_the_readme_names_the_command() -> None:
    text = (Path(__file__).resolve().parents[2] / "README.md").read_text(encoding="utf-8")
    assert "vergence look --pixel" in text
