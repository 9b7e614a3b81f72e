"""Runs metric and controller before a faulty head, and measures how each fault is named and recovered from."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from vergence_bringup.testing.ros.faults import Fault
from vergence_bringup.testing.ros.faulty_head import FaultyHead
from vergence_bringup.testing.textured_wall import TexturedWall
from vergence_common.executor import make_executor
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_msgs.msg import GazeState

NAMED_WITHIN_S, RECOVERED_WITHIN_S = 2.0, 5.0
"""Limits of a fault's diagnostic after it begins, and of its absence after it ends [s]."""

_FALSE_RAD = math.radians(1.5)
_NEARER_RAD = math.radians(6.0)
_AWAKE_S = 1.5  # by then the cameras' noise is known
_SETTLED_S, _SETTLED_REPORTS = 1.0, 50  # a claim of before the fault is no claim about it; both must have passed
_LEAST_S = 1.5
_REST_S, _REST_RAD = 0.5, math.radians(0.3)


@dataclass(frozen=True)
class Outcome:
    """What a fault led to: times to its diagnostic and from its end to its absence [s], NaN where it never came.

    `said` is the diagnostic's message; `false_verged` counts the reports that claimed verged eyes that were not;
    `held` is True if at the fault's end the eyes were reported as not verged and had rested for half a second.
    """

    named_s: float
    said: str
    false_verged: int
    held: bool
    recovered_s: float

    @property
    def named(self) -> bool:
        """Whether the fault was named in time."""
        return self.named_s <= NAMED_WITHIN_S

    @property
    def recovered(self) -> bool:
        """Whether it was no longer named in time after its end."""
        return self.recovered_s <= RECOVERED_WITHIN_S


class FaultTrial:
    """The graph in one process, on a context of its own; use as a context manager."""

    def __init__(self, domain_id: int | None = None) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain_id)
        self._executor = make_executor(self._context)
        self._statuses: dict[str, DiagnosticStatus] = {}
        self._arrived_s: dict[str, float] = {}
        self.verged = False
        self._since_s, self._reports, self._false = math.inf, 0, 0
        self.head = FaultyHead(TexturedWall(), context=self._context)
        verge = [Parameter("start", value="verge")]
        self._nodes: list[Node] = [
            self.head,
            EdgeMetricNode(context=self._context),
            GazeControllerNode(context=self._context, parameter_overrides=verge),
            Node("fault_trial", context=self._context),
        ]
        for node in self._nodes:
            self._executor.add_node(node)
        self._nodes[-1].create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 50)
        self._nodes[-1].create_subscription(GazeState, "gaze/state", self._on_state, 10)

    def __enter__(self) -> "FaultTrial":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for node in self._nodes:
            close = getattr(node, "close", None)
            if close is not None:
                close()
            node.destroy_node()
        self._executor.shutdown()
        self._context.try_shutdown()

    def wait_until_verged(self, timeout_s: float = 60.0) -> bool:
        """Run for a while and until the eyes are verged; return whether they are."""
        began_s = time.monotonic()
        self._wait(lambda: time.monotonic() - began_s > _AWAKE_S, timeout_s)
        return math.isfinite(self._wait(lambda: self.verged, timeout_s))

    def run(self, fault: Fault, timeout_s: float = 30.0) -> Outcome:
        """Inject a fault until it is named and a while longer, end it, and wait until it is no longer named."""
        self._since_s, self._reports, self._false = time.monotonic() + _SETTLED_S, 0, 0
        fault.inject(self.head)
        if fault.wall_moves:
            self.head.wall.goal_rad += _NEARER_RAD
        began_s = time.monotonic()
        named_s = self._wait(lambda: fault.words in self._said(fault.source, began_s), timeout_s)
        said = self._said(fault.source, began_s)
        self._wait(lambda: self._reports > _SETTLED_REPORTS, timeout_s)
        self._wait(lambda: time.monotonic() - began_s > _SETTLED_S + _LEAST_S, timeout_s)
        at_rest = self.head.joints_rad
        self._wait(lambda: time.monotonic() - began_s > _SETTLED_S + _LEAST_S + _REST_S, timeout_s)
        held = not self.verged and float(np.abs(self.head.joints_rad - at_rest).max()) < _REST_RAD
        false, self._since_s = self._false, math.inf
        self.head.heal()
        ended_s = time.monotonic()
        recovered_s = self._wait(lambda: self._is_over(fault, ended_s), timeout_s)
        if fault.wall_moves:
            self.head.wall.goal_rad -= _NEARER_RAD
        return Outcome(named_s, said, false, held, recovered_s)

    def _is_over(self, fault: Fault, since_s: float) -> bool:
        said = self._said(fault.source, since_s)
        return bool(said) and fault.words not in said

    def _said(self, source: str, since_s: float) -> str:
        """Return what a diagnostic has said since then, "" if nothing."""
        status = self._statuses.get(source)
        return status.message if status is not None and self._arrived_s[source] > since_s else ""

    def _wait(self, condition: Callable[[], bool], timeout_s: float) -> float:
        """Run until a condition holds; return the time it took [s], NaN if it never held."""
        began_s = time.monotonic()
        while not condition():
            if time.monotonic() - began_s > timeout_s:
                return math.nan
            self._executor.spin_once(timeout_sec=0.05)
        return time.monotonic() - began_s

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._statuses[status.name], self._arrived_s[status.name] = status, time.monotonic()

    def _on_state(self, message: GazeState) -> None:
        self.verged = message.verged
        self._reports += 1
        settled = time.monotonic() > self._since_s and self._reports > _SETTLED_REPORTS
        if message.verged and settled and abs(self.head.vergence_error_rad) > _FALSE_RAD:
            self._false += 1
