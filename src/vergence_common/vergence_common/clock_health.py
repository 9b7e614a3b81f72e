"""Whether the clock that a node goes by goes on: simulated time stands still where nothing publishes /clock."""

from time import monotonic

from rclpy.node import Node

from vergence_rig.report import ERROR, OK, WARN, Report

STANDS_AFTER_S = 1.5


class ClockHealth:
    """Reports on /clock by a steady clock, at every call of `report`."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._newest_ns, self._since_s = 0, monotonic()

    def report(self) -> Report | None:
        """Return the diagnostic; None for a node that does not use simulated time."""
        clock = self._node.get_clock()
        now_s = monotonic()
        if not self._node.has_parameter("use_sim_time") or not self._node.get_parameter("use_sim_time").value:
            self._newest_ns, self._since_s = 0, now_s
            return None
        now_ns = clock.now().nanoseconds
        if now_ns != self._newest_ns:
            self._newest_ns, self._since_s = now_ns, now_s
        stands_s = now_s - self._since_s
        values = {"time_s": now_ns * 1e-9, "publishers": self._node.count_publishers("/clock")}
        publishers = "nothing publishes it" if not values["publishers"] else "its publisher is silent"
        if not now_ns:
            hint = "start what publishes it (sim_node, ros2 bag play --clock), or set use_sim_time to false"
            return Report(ERROR, f"no /clock arrives ({publishers}), and use_sim_time is true: {hint}", values)
        if stands_s > STANDS_AFTER_S:
            return Report(WARN, f"no /clock arrives: simulated time has stood for {stands_s:.1f} s", values)
        return Report(OK, "simulated time goes on", values)
