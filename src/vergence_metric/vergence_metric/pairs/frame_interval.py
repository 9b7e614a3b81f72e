"""Period of a stream of frames, and the earliest time of its next frame, from the stamps alone."""

from bisect import bisect_left, insort
from collections import deque

WINDOW = 64
_ENOUGH = 4


class FrameInterval:
    """Estimates the period from the intervals between stamps; robust to lost frames and jitter."""

    __slots__ = ("_recent", "_sorted", "earliest_ns", "period_ns")

    def __init__(self) -> None:
        self._recent: deque[int] = deque()
        self._sorted: list[int] = []
        self.period_ns: int | None = None
        """Median interval [ns]; None before the first."""
        self.earliest_ns = 0
        """Lower bound of the interval to the next frame [ns]: the shortest recent interval, less its distance from the
        median, less a margin while there are few intervals. 0 at first."""

    def add(self, interval_ns: int) -> None:
        """Add the interval between two successive frames [ns]."""
        recent, ordered = self._recent, self._sorted
        if len(recent) == WINDOW:
            del ordered[bisect_left(ordered, recent.popleft())]
        recent.append(interval_ns)
        insort(ordered, interval_ns)
        count = len(ordered)
        self.period_ns = median = ordered[count // 2]
        if count >= _ENOUGH:
            self.earliest_ns = max(2 * ordered[0] - median - 4 * median // count**2, 0)
