"""A timer that goes on at a low rate while little is to be done."""

from collections.abc import Callable

from rclpy.clock import Clock
from rclpy.node import Node


class TwoRates:
    """A timer of a node with two periods, the short one at first; it calls once at each moment of its clock.

    rclpy's events executor may call a due timer twice, which then leaves out its next period. In simulated time, which
    stands still meanwhile, a second call has the stamp of the first.
    """

    def __init__(
        self, node: Node, callback: Callable[[], None], fast_s: float, slow_s: float, clock: Clock | None = None
    ) -> None:
        self._periods_ns = {True: round(1e9 * fast_s), False: round(1e9 * slow_s)}
        self._callback, self._clock = callback, clock or node.get_clock()
        self.called_ns = -1
        """The clock's time at the newest call [ns]; negative before the first."""
        self.fast = True
        """Which period it has."""
        self.timer = node.create_timer(fast_s, self._call, clock=self._clock)

    def set_fast(self, fast: bool) -> bool:
        """Use this period from now on; return whether it was the other one. The shorter begins at once."""
        if fast is self.fast:
            return False
        self.fast = fast
        self.timer.timer_period_ns = self._periods_ns[fast]
        if fast:
            self.timer.reset()
        return True

    def _call(self) -> None:
        now_ns = self._clock.now().nanoseconds
        if now_ns == self.called_ns:
            self.timer.reset()
            return
        self.called_ns = now_ns
        self._callback()
