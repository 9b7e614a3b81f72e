"""What a page asks of the head: goals of gaze/look_at, and the services that stop, enable and park it."""

import math
from collections import deque
from functools import partial
from time import monotonic
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import SetBool, Trigger

from vergence_common.goal_requests import request_goal, request_result
from vergence_common.stamps import from_nanoseconds
from vergence_msgs.action import LookAt
from vergence_msgs.msg import GazeGoal
from vergence_rig.rig import Rig
from vergence_web.requests import Answer, Command, DetectedClass, Message, Pixel
from vergence_web.ros.answering import Reply, answering
from vergence_web.ros.service_calls import ServiceCalls

_ACCEPTED_WITHIN_S, _REASON_WITHIN_S = 5.0, 2.0
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_GAZE, _SERVO = "gaze_controller_node", "servo_node"
_SERVICES = {
    "stop": (Trigger, f"{_GAZE}/stop", None),
    "enable": (SetBool, f"{_GAZE}/enable", True),
    "disable": (SetBool, f"{_GAZE}/enable", False),
    "park": (Trigger, f"{_SERVO}/park", None),
}
"""By command: type, name, and the value of a SetBool."""


class HeadCommands:
    """Sends goals and calls services; answers come by `reply`, in the executor's thread."""

    def __init__(self, node: Node, rig: Rig) -> None:
        self._node, self._rig = node, rig
        self._look_at = ActionClient(node, LookAt, "gaze/look_at")
        self._services = ServiceCalls(node)
        self._clients = {name: self._services.client(name, kind) for kind, name, _ in _SERVICES.values()}
        self._sent: dict[int, tuple[float, Any, Message, Reply]] = {}
        self._goals: dict[int, tuple[Any, Message, Reply]] = {}
        self._count = 0
        self._unexplained: deque[tuple[float, Message, Reply]] = deque()
        self._reasons: Any = None

    def available(self) -> dict[str, bool]:
        """Return whether what each command needs is there."""
        ready = {command: self._clients[name].service_is_ready() for command, (_, name, _) in _SERVICES.items()}
        goals = self._look_at.server_is_ready()
        return {**ready, **dict.fromkeys(("look", "hold", "centre", "motion", "cancel"), goals)}

    def perform(self, message: Message, reply: Reply) -> None:
        """Do what a page asks for."""
        request = message.request
        if isinstance(request, Command) and request.name in _SERVICES:
            self._call(request.name, message, reply)
        elif isinstance(request, Command) and request.name == "cancel":
            self._cancel(message, reply)
        else:
            self._look(self._goal(request), message, reply)

    def check(self) -> None:
        """Answer the goals whose controller has gone, and those that it has not received: nothing else will."""
        for number, (until_s, sent, message, reply) in list(self._sent.items()):
            if monotonic() > until_s:
                del self._sent[number]
                sent.cancel()
                text = f"gaze/look_at has not answered within {_ACCEPTED_WITHIN_S:g} s: try again"
                reply(Answer(message.number, False, text))
        while self._unexplained and monotonic() > self._unexplained[0][0]:
            _, message, reply = self._unexplained.popleft()
            reply(Answer(message.number, False, "gaze/look_at rejected the goal; gaze/goal has not said why"))
        if self._reasons is not None and not self._unexplained:
            self._node.destroy_subscription(self._reasons)
            self._reasons = None
        if self._goals and not self._look_at.server_is_ready():
            for _, message, reply in self._goals.values():
                reply(Answer(message.number, False, f"{_GAZE} has gone: the goal has no result"))
            self._goals.clear()

    def _goal(self, request: Any) -> LookAt.Goal:
        if isinstance(request, DetectedClass):
            return LookAt.Goal(kind=LookAt.Goal.CLASS, class_name=request.name)
        if isinstance(request, Pixel):
            goal = LookAt.Goal(kind=LookAt.Goal.PIXEL, depth_m=math.nan)
            goal.header.stamp = from_nanoseconds(request.stamp_ns)
            goal.eye = LookAt.Goal.EYE_LEFT if request.left else LookAt.Goal.EYE_RIGHT
            eye = "left" if request.left else "right"
            setattr(goal, f"{eye}_x_px", request.x_px)
            setattr(goal, f"{eye}_y_px", request.y_px)
            goal.width_px, goal.height_px = request.width_px, request.height_px
            return goal
        if request == Command("motion"):
            return LookAt.Goal(kind=LookAt.Goal.MOTION)
        if request == Command("hold"):
            return LookAt.Goal(kind=LookAt.Goal.RELATIVE_ANGLES)
        return LookAt.Goal(kind=LookAt.Goal.ANGLES, vergence_rad=max(0.0, self._rig.minimum_vergence_rad))

    def _look(self, goal: LookAt.Goal, message: Message, reply: Reply) -> None:
        if not self._look_at.server_is_ready():
            topic = self._node.resolve_topic_name("gaze/look_at")
            reply(Answer(message.number, False, f"nothing serves {topic}: {_GAZE} does"))
            return
        self._count += 1
        number = self._count
        accepted = partial(self._on_accepted, number, message, reply)
        sent = request_goal(self._node, self._look_at, goal)
        self._sent[number] = (monotonic() + _ACCEPTED_WITHIN_S, sent, message, reply)
        sent.add_done_callback(answering(self._node, message, reply, accepted))

    def _on_accepted(self, number: int, message: Message, reply: Reply, future: Any) -> None:
        if self._sent.pop(number, None) is None:  # given up: the page shows that it failed
            return
        handle = future.result()
        if not handle.accepted:
            self._unexplained.append((monotonic() + _REASON_WITHIN_S, message, reply))
            if self._reasons is None:  # the reason is latched
                self._reasons = self._node.create_subscription(GazeGoal, "gaze/goal", self._on_goal, _LATCHED)
            return
        self._goals[number] = (handle, message, reply)
        reply(Answer(message.number, True, "the goal is accepted", last=False))
        ended = answering(self._node, message, reply, partial(self._on_result, number))
        request_result(self._node, handle).add_done_callback(ended)

    def _on_goal(self, report: GazeGoal) -> None:
        if report.state == GazeGoal.REJECTED and self._unexplained:
            _, message, reply = self._unexplained.popleft()
            reply(Answer(message.number, False, f"{_result_name(report.result)}: {report.reason}"))

    def _on_result(self, number: int, future: Any) -> None:
        _, message, reply = self._goals.pop(number, (None, None, None))
        answer = future.result()
        if message is None or reply is None:
            return
        if answer.status == GoalStatus.STATUS_UNKNOWN:
            text = f"{_GAZE} does not have the goal: it rejected it, or was started anew meanwhile"
            reply(Answer(message.number, False, text))
            return
        result = answer.result
        name = _result_name(result.result)
        ok = result.result in (LookAt.Result.VERGED, LookAt.Result.AT_POINT)
        because = f": {result.reason}" if result.reason else ""
        values = {"result": name, "time_s": round(result.time_s, 3)}
        reply(Answer(message.number, ok, f"{name} after {result.time_s:.2f} s{because}", values))

    def _cancel(self, message: Message, reply: Reply) -> None:
        for handle, _, _ in list(self._goals.values()):
            handle.cancel_goal_async()
        text = "the goal is cancelled" if self._goals else "there is no goal of a page to cancel"
        reply(Answer(message.number, bool(self._goals), text))

    def _call(self, command: str, message: Message, reply: Reply) -> None:
        kind, name, value = _SERVICES[command]
        if not self._clients[name].service_is_ready():
            full = self._node.resolve_service_name(name)
            reply(Answer(message.number, False, f"nothing serves {full}: {name.partition('/')[0]} does"))
            return

        def answer(result: Any) -> None:
            reply(Answer(message.number, bool(result.success), str(result.message)[:300] or command))

        asked = kind.Request() if value is None else kind.Request(data=value)
        self._services.call(name, kind, asked, answering(self._node, message, reply, answer))


def _result_name(result: int) -> str:
    names = (name for name in dir(LookAt.Result) if name.isupper() and getattr(LookAt.Result, name) == result)
    return next(names, str(result))
