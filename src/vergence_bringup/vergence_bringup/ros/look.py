"""`vergence look`: sends a goal to gaze/look_at, shows its progress and result; needs rclpy, not the ros2 command."""

import argparse
import signal
import sys
import threading
import time
from collections import deque
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

from vergence_bringup.commands.look_request import (
    LookRequest,
    add_arguments,
    feedback_line,
    look_request,
    result_line,
)
from vergence_bringup.figures.distance_text import distance_text
from vergence_bringup.graph_errors import GraphError
from vergence_common.goal_requests import request_goal, request_result
from vergence_common.qos import STATE_QOS
from vergence_common.start import checked_namespace, init
from vergence_msgs.action import LookAt
from vergence_msgs.msg import GazeGoal, GazeState

__all__ = ["add_arguments", "run"]

_NOT_VERGED, _INTERRUPTED = 1, 130
_CANCEL_S, _SLICE_S, _REASON_S, _STATE_S = 5.0, 0.1, 2.0, 1.0
_ASKED = (
    "kind",
    "point",
    "left_x_px",
    "left_y_px",
    "right_x_px",
    "right_y_px",
    "class_name",
    "version_rad",
    "tilt_rad",
)
"""What distinguishes a goal from others."""


def run(options: argparse.Namespace) -> int:
    """Look; returns 0 if the eyes verged, 1 if not, 2 for bad input, 130 after Ctrl-C, which cancels the goal."""
    request = look_request(options)
    stop_asked = threading.Event()
    # Without rclpy's handlers, since after Ctrl-C the goal is still to be cancelled; and without an exception in the
    # middle of whatever rclpy does then.
    init(signal_handler_options=SignalHandlerOptions.NO)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop_asked.set())
    look = Look(options.namespace, stop_asked)
    try:
        return look.at(request, options.time_limit, options.wait)
    except GraphError as error:
        print(f"vergence look: {error}", file=sys.stderr)
        return _NOT_VERGED
    except _InterruptedError:
        look.cancel()
        print("\nended: the goal is cancelled", file=sys.stderr)
        return _INTERRUPTED
    finally:
        look.close()


class _InterruptedError(Exception):
    """Ctrl-C, or SIGTERM."""


class Look:
    """A client of gaze/look_at, spun by the calling thread until `stop_asked` is set."""

    def __init__(self, namespace: str, stop_asked: threading.Event) -> None:
        self._stop_asked = stop_asked
        self._node = Node("vergence_look", namespace=checked_namespace(namespace))
        self._client = ActionClient(self._node, LookAt, "gaze/look_at")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._sent: Any = None
        self._rejected: list[GazeGoal] = []
        self._goal: LookAt.Goal | None = None
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._node.create_subscription(GazeGoal, "gaze/goal", self._on_goal, latched)
        self._states: deque[GazeState] = deque(maxlen=1)
        # From the start: a subscription of the end's would be discovered too late.
        self._node.create_subscription(GazeState, "gaze/state", lambda state: self._states.append(state), STATE_QOS)
        self._progress = _Progress()

    def at(self, request: LookRequest, time_limit_s: float, wait_s: float) -> int:
        """Send the goal, show its progress until it ends, and return the exit status. Raises GraphError."""
        self._wait_for_controller(wait_s)
        print(f"looking at {request.text}", flush=True)
        self._goal = _goal(request, time_limit_s)
        self._sent = request_goal(self._node, self._client, self._goal, self._on_feedback)
        handle = self._spin_until(self._sent)
        if not handle.accepted:
            print(self._rejection(), flush=True)
            return _NOT_VERGED
        answer = self._spin_until(request_result(self._node, handle))
        self._progress.end()
        if answer.status == GoalStatus.STATUS_UNKNOWN:
            raise GraphError(
                "gaze_controller_node does not have the goal: it rejected it, or was started anew meanwhile"
            )
        result = answer.result
        point, frame = result.fixation_point.point, result.fixation_point.header.frame_id
        name = result_name(result.result)
        place, distance = (point.x, point.y, point.z), self._distance()
        print(result_line(name, result.time_s, result.reason, place, frame, result.vergence_rad, distance), flush=True)
        return 0 if result.result == LookAt.Result.VERGED else _NOT_VERGED

    def _distance(self) -> str:
        """Return the distance of the target, with its interval, as the next gaze/state has it; "" if it is unknown."""
        self._states.clear()
        deadline_s = time.monotonic() + _STATE_S
        while not self._states:
            if time.monotonic() > deadline_s or not self._node.count_publishers("gaze/state"):
                return ""
            self._spin_once()
        state = self._states[0]
        return distance_text(state.distance_m, state.distance_low_m, state.distance_high_m)

    def _rejection(self) -> str:
        """Return why the goal was rejected, as gaze/goal says right after."""
        deadline_s = time.monotonic() + _REASON_S
        while not self._rejected and time.monotonic() < deadline_s:
            self._spin_once()
        if not self._rejected:
            return "the goal was rejected, and gaze/goal says not why"
        report = self._rejected[-1]
        return f"{result_name(report.result)}: {report.reason}"

    def _on_goal(self, report: GazeGoal) -> None:
        # The last one is latched: one of another goal may come first.
        same = self._goal is not None and all(getattr(report, name) == getattr(self._goal, name) for name in _ASKED)
        if same and report.state == GazeGoal.REJECTED:
            self._rejected.append(report)

    def cancel(self) -> None:
        """Cancel the goal, if one was sent."""
        self._progress.end()
        if self._sent is None:
            return
        self._executor.spin_until_future_complete(self._sent, timeout_sec=_CANCEL_S)
        if not self._sent.done():
            self._sent.cancel()
        elif self._sent.result().accepted:
            cancelled = self._sent.result().cancel_goal_async()
            self._executor.spin_until_future_complete(cancelled, timeout_sec=_CANCEL_S)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown()

    def _wait_for_controller(self, wait_s: float) -> None:
        deadline_s = time.monotonic() + wait_s
        while not self._client.server_is_ready():
            if time.monotonic() > deadline_s:
                name = self._node.resolve_topic_name("gaze/look_at")
                raise GraphError(
                    f"nothing serves {name} after {wait_s:g} s: gaze_controller_node does, in sim.launch.py, "
                    "rig.launch.py or by itself (same ROS_DOMAIN_ID and namespace?)"
                )
            self._spin_once()

    def _spin_once(self) -> None:
        self._executor.spin_once(timeout_sec=_SLICE_S)
        if self._stop_asked.is_set():
            raise _InterruptedError

    def _spin_until(self, future: Any) -> Any:
        while not future.done():
            self._spin_once()
            if not future.done() and not self._client.server_is_ready():
                raise GraphError("gaze_controller_node has gone: the goal has no result")
        return future.result()

    def _on_feedback(self, message: Any) -> None:
        feedback = message.feedback
        residuals = (feedback.version_residual_deg, feedback.vergence_residual_deg, feedback.tilt_residual_deg)
        self._progress.show(feedback.phase_name, feedback_line(feedback.phase_name, residuals, feedback.contrast))


class _Progress:
    """Lines of progress: on a terminal the last one is redrawn, elsewhere one is printed per phase."""

    def __init__(self) -> None:
        self._phase, self._open = "", False

    def show(self, phase: str, line: str) -> None:
        if sys.stdout.isatty():
            start = "\r" if phase == self._phase else "\n" * self._open
            print(f"{start}{line}\033[K", end="", flush=True)
            self._open = True
        elif phase != self._phase:
            print(line, flush=True)
        self._phase = phase

    def end(self) -> None:
        if self._open:
            print(flush=True)
        self._open = False


def result_name(result: int) -> str:
    """Return the name of a result in LookAt.action."""
    names = (name for name in dir(LookAt.Result) if name.isupper() and getattr(LookAt.Result, name) == result)
    return next(names, str(result))


def _goal(request: LookRequest, time_limit_s: float) -> LookAt.Goal:
    goal = LookAt.Goal(kind=getattr(LookAt.Goal, request.kind), time_limit_s=time_limit_s)
    for name, value in request.fields.items():
        setattr(goal, name, value)
    if request.point_m is not None:
        goal.point.x, goal.point.y, goal.point.z = request.point_m
        goal.header.frame_id = request.frame
    return goal
