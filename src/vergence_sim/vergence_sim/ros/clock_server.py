"""Publishes /clock for the thread that owns a simulated world, and receives how far the nodes have followed."""

import functools
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock as SteadyClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from vergence_common.diagnostics import OK, WARN, Diagnostics, Report
from vergence_common.qos import QosWatch
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_msgs.msg import BoxVergence, EyeRotation, GazeState, TargetTrack
from vergence_sim.clock_parameters import ClockParameters
from vergence_sim.simulated_clock import PAIRS, TICKS, SimulatedClock

START_NS = 100_000_000_000
"""Simulated time at the start [ns]: a stamp of zero means "not set"."""

FOLLOWERS: dict[str, tuple[Any, str]] = {
    "gaze/state": (GazeState, TICKS),
    "vergence/track": (TargetTrack, PAIRS),
    "vergence/box": (BoxVergence, PAIRS),
    "vergence/eye_rotation": (EyeRotation, PAIRS),
}
"""The outputs that the clock waits for. edge_metric_node's last message of a pair is its track."""

_REPEAT_S = 0.1
_LOOK_S, _QUIET_S = 0.25, 1.0
_CLOCK_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


class ClockServer:
    """The clock of a world. Callbacks only queue what they received; all else is for the world's thread."""

    def __init__(
        self,
        node: Node,
        parameters: Callable[[], ClockParameters],
        skew_s: float,
        qos: QosWatch,
        diagnostics: Diagnostics,
    ) -> None:
        self._node, self._parameters = node, parameters
        self._clock = SimulatedClock(
            parameters(), {topic: kind for topic, (_, kind) in FOLLOWERS.items()}, START_NS, round(skew_s * 1e9)
        )
        self._qos = qos
        self._wake = threading.Event()
        self._received: deque[Callable[[], None]] = deque()
        self._published_s = 0.0
        self._asked = False
        self._present: frozenset[str] = frozenset()
        self._present_since_s = time.monotonic()
        self._followed: dict[str, Any] = {}
        self._named: set[str] = set()
        self._publisher = qos.create_publisher(Clock, "/clock", _CLOCK_QOS)
        self._stands = qos.create_publisher(Clock, "sim/stands_at")
        # After every other subscription: what else a client sent before this has then been received.
        self._run_until = qos.create_subscription(Clock, "sim/run_until", self._on_run_until)
        self._timer = node.create_timer(_LOOK_S, self._look_around, clock=SteadyClock(clock_type=ClockType.STEADY_TIME))
        diagnostics.add("clock", self._report)

    @property
    def now_s(self) -> float:
        """Simulated time [s]."""
        return self._clock.now_ns * 1e-9

    @property
    def next_s(self) -> float:
        """Simulated time at the next tick [s]."""
        return self._clock.next_ns * 1e-9

    def wake(self) -> None:
        """End a wait."""
        self._wake.set()

    def wait(self) -> None:
        """Wait until something is received, the next tick may come, or /clock is to be repeated."""
        left_s = self._clock.wait_s(time.monotonic())
        self._wake.wait(min(max(left_s, 0.0) or _REPEAT_S, _REPEAT_S))
        self._wake.clear()

    def update(self) -> None:
        """Note what has been received, and publish what is to be repeated."""
        while self._received:
            self._received.popleft()()
        now_s = time.monotonic()
        # A node that has started meanwhile, or has missed a message, receives the time.
        if now_s - self._published_s > _REPEAT_S:
            self._publish(now_s)
        self._name_given_up()
        if self._asked and self._clock.at_limit and self._is_settled and self._clock.is_followed(now_s):
            self._asked = False
            self._stands.publish(Clock(clock=from_nanoseconds(self._clock.now_ns)))

    def may_advance(self) -> bool:
        """Return whether the events up to the next tick may happen."""
        return self._is_settled and self._clock.may_advance(time.monotonic())

    def is_followed(self) -> bool:
        """Return whether every output that is due has been received."""
        return self._clock.is_followed(time.monotonic())

    def add_image(self, eye: str, stamp_ns: int) -> None:
        """Note a published image."""
        self._clock.add_image(eye, stamp_ns, time.monotonic())

    def advance(self) -> None:
        """Go on to the next tick."""
        self._clock.parameters = self._parameters()
        now_s = time.monotonic()
        self._clock.advance(now_s)
        self._publish(now_s)

    def _publish(self, now_s: float) -> None:
        self._published_s = now_s
        self._publisher.publish(Clock(clock=from_nanoseconds(self._clock.now_ns)))

    @property
    def _is_settled(self) -> bool:
        """True if every output that is published is followed; only stepped time waits for that."""
        return not self._clock.parameters.stepped or (self._is_quiet and self._present <= self._followed.keys())

    @property
    def _is_quiet(self) -> bool:
        return time.monotonic() - self._present_since_s >= _QUIET_S

    def _look_around(self) -> None:
        """Follow the outputs that are published; called in the executor's thread.

        A sample is sent to its readers in the order in which they were matched, one after the other. This node must be
        the last: what it has received, the controller has then received too, before the next tick. Hence it subscribes
        to outputs only when no further one has appeared for a while.
        """
        present = frozenset(
            topic for topic in FOLLOWERS if self._node.count_publishers(self._node.resolve_topic_name(topic))
        )
        for topic in self._present - present:
            self._node.get_logger().info(f"{topic}: no longer published: simulated time does not wait for it")
            self._queue(functools.partial(self._clock.forget, topic))
        if present != self._present:
            self._present, self._present_since_s = present, time.monotonic()
        if self._is_quiet:
            for topic in present - self._followed.keys():
                self._followed[topic] = self._follow(topic, *FOLLOWERS[topic])

    def _follow(self, topic: str, kind: Any, what: str) -> Any:
        def receive(message: Any) -> None:
            stamp_ns = to_nanoseconds(message.header.stamp if what == PAIRS else message.cycle_stamp)
            self._queue(lambda: self._clock.answer(topic, stamp_ns, time.monotonic()))

        return self._qos.create_subscription(kind, topic, receive)

    def _on_run_until(self, message: Clock) -> None:
        time_ns = to_nanoseconds(message.clock)

        def run_until() -> None:
            self._clock.run_until(time_ns)
            self._asked = True

        self._queue(run_until)

    def _queue(self, action: Callable[[], None]) -> None:
        self._received.append(action)
        self._wake.set()

    def _name_given_up(self) -> None:
        given_up = set(self._clock.given_up)
        for topic in given_up - self._named:
            self._node.get_logger().warning(
                f"{topic}: nothing for {self._clock.parameters.timeout_s:g} s of real time: simulated time no longer "
                "waits for it"
            )
        for topic in self._named - given_up:
            self._node.get_logger().info(f"{topic}: simulated time waits for it again")
        self._named = given_up

    def _report(self) -> Report:
        rate, given_up, due = self._clock.rate(time.monotonic()), self._clock.given_up, self._clock.due
        values = {"time_s": self.now_s, "real_time_factor": rate, "followed": ", ".join(self._followed)}
        values |= {"due": ", ".join(due), "silent": ", ".join(given_up)}
        if given_up:
            return Report(
                WARN, f"simulated time no longer waits for {', '.join(given_up)}: nothing is published", values
            )
        if self._clock.at_limit:
            return Report(OK, f"simulated time stands at {self.now_s:.2f} s until sim/run_until lets it go on", values)
        return Report(OK, f"simulated time runs at {rate:.2f} of real time", values)
