"""A node's health on /diagnostics, from small functions that each report on one thing.

Once a second, and half a second after a level has changed at the latest.
"""

import socket
from collections.abc import Callable
from itertools import islice

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from vergence_common.clock_health import ClockHealth
from vergence_rig.report import ERROR, OK, STALE, WARN, Report

__all__ = ["ERROR", "OK", "STALE", "WARN", "Diagnostics", "Report"]

PERIOD_S = 1.0

LONGEST_MESSAGE, LONGEST_VALUE, MOST_VALUES = 500, 300, 100
"""Bounds of what one status says: what is counted and quoted may come from outside."""


class Diagnostics:
    """Publishes the reports of one node. Names are prefixed by the node's own, as `diagnostic_updater` does.

    `hardware_id` names what the reports are about; empty for the computer that the node runs on.
    """

    def __init__(self, node: Node, hardware_id: str = "") -> None:
        self._node = node
        self._hardware_id = hardware_id or socket.gethostname()
        self._sources: dict[str, Callable[[], Report]] = {}
        self._clock = ClockHealth(node)
        self._message, self._statuses = DiagnosticArray(), dict[str, DiagnosticStatus]()
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        # Simulated time may stand, and then the reports say why.
        self._levels: dict[str, int] = {}
        self._due = False
        self._timer = node.create_timer(PERIOD_S / 2, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def add(self, name: str, report: Callable[[], Report]) -> None:
        """Call `report` at every publication. A second source of the same name replaces the first."""
        self._sources[name] = report

    def collect(self) -> dict[str, Report]:
        """Return every report now; a source that fails is itself reported as an error."""
        reports = {}
        for name, source in self._sources.items():
            try:
                reports[name] = source()
            except Exception as error:  # a report must never end the node it reports on
                reports[name] = Report(ERROR, f"the report failed: {type(error).__name__}: {error}")
        clock = self._clock.report()
        return reports if clock is None else {"clock": clock, **reports}

    def publish(self) -> None:
        """Publish all reports."""
        self._publish(self.collect())

    def _look(self) -> None:
        """Publish every second time, and at once where a level has changed."""
        reports = self.collect()
        self._due = not self._due
        if self._due or {name: report.level for name, report in reports.items()} != self._levels:
            self._publish(reports)

    def _publish(self, reports: dict[str, Report]) -> None:
        self._levels = {name: report.level for name, report in reports.items()}
        self._message.header.stamp = self._node.get_clock().now().to_msg()
        self._message.status = [self._status(name, report) for name, report in reports.items()]
        self._publisher.publish(self._message)

    def _status(self, name: str, report: Report) -> DiagnosticStatus:
        """Return the status, made once per name and set of values, because building messages is slow."""
        status = self._statuses.get(name)
        values = dict(islice(report.values.items(), MOST_VALUES))
        if status is None or [entry.key for entry in status.values] != [_bounded(key, LONGEST_VALUE) for key in values]:
            status = self._statuses[name] = DiagnosticStatus(
                name=f"{self._node.get_fully_qualified_name().lstrip('/')}: {name}",
                hardware_id=self._hardware_id,
                values=[KeyValue(key=_bounded(key, LONGEST_VALUE)) for key in values],
            )
        status.level, status.message = bytes([report.level]), _bounded(report.message, LONGEST_MESSAGE)
        for entry, value in zip(status.values, values.values(), strict=True):
            entry.value = f"{value:.6g}" if isinstance(value, float) else _bounded(str(value), LONGEST_VALUE)
        return status


def _bounded(text: str, longest: int) -> str:
    """Return a text of at most so many characters, which a message can carry."""
    kept = text if len(text) <= longest else f"{text[: longest - 4]} ..."
    # Names that come from a topic or a device may hold anything; a message is UTF-8 without NUL.
    return kept if kept.isprintable() else kept.replace("\0", "\\0").encode("utf-8", "backslashreplace").decode()
