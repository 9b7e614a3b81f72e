"""How time passes for the demo: in real time, or in steps of the simulator's time that the demo lets pass."""

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from vergence_bringup.graph_errors import GraphError
from vergence_common.qos import STATE_QOS
from vergence_common.stamps import from_nanoseconds, to_nanoseconds

Check = Callable[[], None]
"""Called while something is waited for; raises when a process has ended."""

_POLL_S = 0.25
_STEP_NS = 20_000_000
_ANSWER_S = 60.0
_STAND_S = 180.0
_AFTER_A_GOAL_S = 0.2
_BEGINS_NS = 1_000_000_000
_DISCOVERY_S = 1.0
_OUTPUTS = ("ground_truth/vergence", "vergence/edge", "gaze/state", "vergence/box", "vergence/eye_rotation")


class Timeline(Protocol):
    """Time as the demo counts it."""

    def now_s(self) -> float:
        """Return the time [s]."""

    def begin(self, check_alive: Check) -> None:
        """Begin: every process has been started."""

    def wait_for(self, what: str, condition: Callable[[], Any], timeout_s: float, check_alive: Check) -> Any:
        """Return the first true value of `condition`, for which time passes; raises GraphError after `timeout_s`."""

    def wait_for_answer(self, what: str, condition: Callable[[], Any], timeout_s: float, check_alive: Check) -> Any:
        """Return the first true value of `condition`, which needs no time to pass."""

    def settle(self, duration_s: float, check_alive: Check) -> None:
        """Let time pass."""

    def settle_after_goal(self, ended_s: float, check_alive: Check) -> None:
        """Let time pass until a while after a goal that ended at `ended_s`, whenever its result has arrived."""

    def align(self, check_alive: Check) -> None:
        """Let time pass to where a station may begin."""

    def figures(self) -> dict[str, Any]:
        """Return the simulated time that has passed and how fast it did, None where time is real."""


class RealTime:
    """Real time; `changed` is notified of every message."""

    def __init__(self, node: Node, changed: threading.Condition) -> None:
        self._node, self._changed = node, changed

    def now_s(self) -> float:
        """Return the node's time in seconds."""
        return float(self._node.get_clock().now().nanoseconds) * 1e-9

    def begin(self, check_alive: Check) -> None:
        """Time passes anyway."""

    def wait_for(self, what: str, condition: Callable[[], Any], timeout_s: float, check_alive: Check) -> Any:
        """Return the first true value of `condition`, which is called after every message."""
        deadline = time.monotonic() + timeout_s
        while True:
            with self._changed:
                answer = condition()
                if answer:
                    return answer
                left = deadline - time.monotonic()
                if left <= 0:
                    raise GraphError(f"timeout after {timeout_s:g} s waiting for {what}")
                self._changed.wait(min(left, _POLL_S))
            check_alive()

    wait_for_answer = wait_for

    def settle(self, duration_s: float, check_alive: Check) -> None:
        """Sleep."""
        end = time.monotonic() + duration_s
        while (left := end - time.monotonic()) > 0:
            time.sleep(min(left, _POLL_S))
            check_alive()

    def settle_after_goal(self, ended_s: float, check_alive: Check) -> None:
        """Go on at once."""

    def align(self, check_alive: Check) -> None:
        """Go on at once."""

    def figures(self) -> dict[str, Any]:
        """Return that time is real."""
        return {"simulated_s": None, "real_time_factor": None}


class SteppedTime:
    """Simulated time of a simulator that is stepped: it stands wherever the demo decides something.

    So whatever the demo does, it does at the same simulated time in every run. Time limits count simulated time; only
    what needs none, a service's answer, is limited in real time, generously.
    """

    def __init__(self, node: Node, changed: threading.Condition) -> None:
        self._node, self._changed, self._real = node, changed, RealTime(node, changed)
        self._stands_ns: int | None = None
        self._target_ns = self._begun_ns = 0
        self._begun_s = time.monotonic()
        self._run_until = node.create_publisher(Clock, "sim/run_until", STATE_QOS)
        self._subscription = node.create_subscription(Clock, "sim/stands_at", self._on_stand, STATE_QOS)

    def now_s(self) -> float:
        """Return the time at which the simulator stands, or to which it runs just now."""
        return self._target_ns * 1e-9

    def begin(self, check_alive: Check) -> None:
        """Wait until every node is there and the nodes have found one another; then let the simulator begin."""
        for topic in _OUTPUTS:
            self.wait_for_answer(
                f"a publisher of {topic}", partial(self._node.count_publishers, topic), _ANSWER_S, check_alive
            )
        self._real.settle(_DISCOVERY_S, check_alive)
        self._run_to(0, check_alive)
        assert self._stands_ns is not None
        self._target_ns = self._begun_ns = self._stands_ns
        self._begun_s = time.monotonic()
        self.align(check_alive)

    def wait_for(self, what: str, condition: Callable[[], Any], timeout_s: float, check_alive: Check) -> Any:
        """Return the first true value of `condition`, which is called where time stands."""
        deadline_ns = self._target_ns + round(timeout_s * 1e9)
        while True:
            with self._changed:
                answer = condition()
            if answer:
                return answer
            if self._target_ns >= deadline_ns:
                raise GraphError(f"timeout after {timeout_s:g} s of simulated time waiting for {what}")
            self._run_to(self._target_ns + _STEP_NS, check_alive)

    def wait_for_answer(self, what: str, condition: Callable[[], Any], timeout_s: float, check_alive: Check) -> Any:
        """Return the first true value of `condition` while time stands."""
        return self._real.wait_for(what, condition, max(timeout_s, _ANSWER_S), check_alive)

    def settle(self, duration_s: float, check_alive: Check) -> None:
        """Let time pass in steps, so that arrivals are known to a step."""
        end_ns = self._target_ns + round(duration_s * 1e9)
        while self._target_ns < end_ns:
            self._run_to(self._target_ns + _STEP_NS, check_alive)

    def settle_after_goal(self, ended_s: float, check_alive: Check) -> None:
        """Let time pass until a while after the goal: its result may arrive a step earlier or later."""
        self.settle(ended_s + _AFTER_A_GOAL_S - self.now_s(), check_alive)

    def align(self, check_alive: Check) -> None:
        """Let time pass to the next full second: a station begins there in every run, whatever was before."""
        self.settle(-self._target_ns % _BEGINS_NS * 1e-9, check_alive)

    def figures(self) -> dict[str, Any]:
        """Return the simulated time that has passed and how fast it did."""
        simulated_s = (self._target_ns - self._begun_ns) * 1e-9
        factor = simulated_s / max(time.monotonic() - self._begun_s, 1e-3)
        return {"simulated_s": round(simulated_s, 2), "real_time_factor": round(factor, 3)}

    def _run_to(self, time_ns: int, check_alive: Check) -> None:
        self._target_ns = time_ns
        deadline = time.monotonic() + _STAND_S
        asked_s = 0.0
        while True:
            # Asked again: the first request may have come before the subscription.
            if time.monotonic() - asked_s > 1.0:
                asked_s = time.monotonic()
                self._run_until.publish(Clock(clock=from_nanoseconds(time_ns)))
            with self._changed:
                if self._stands_ns is not None and self._stands_ns >= time_ns:
                    return
                self._changed.wait(_POLL_S)
            check_alive()
            if time.monotonic() > deadline:
                raise GraphError(f"sim_node has not come to {time_ns * 1e-9:.2f} s of simulated time in {_STAND_S:g} s")

    def _on_stand(self, message: Clock) -> None:
        with self._changed:
            self._stands_ns = to_nanoseconds(message.clock)
            self._changed.notify_all()
