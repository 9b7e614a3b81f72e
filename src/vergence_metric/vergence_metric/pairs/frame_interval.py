"""The period of a stream of frames, and the earliest time its next frame can come, from the stamps alone."""

from bisect import bisect_left, insort
from collections import deque

WINDOW = 64
_ENOUGH = 4


class FrameInterval:
    """Learns from the intervals between a stream's stamps; lost frames and jitter do not mislead it."""

    __slots__ = ("_recent", "_sorted", "earliest_ns", "period_ns")

    def __init__(self) -> None:
        self._recent: deque[int] = deque()
        self._sorted: list[int] = []
        self.period_ns: int | None = None
        """Median interval [ns]; None before the first."""
        self.earliest_ns = 0
        """No next frame is expected sooner than this after the last [ns]: the shortest interval seen lately, less its
        distance from the median once more, less what few intervals cannot show. 0 at first."""

    def add(self, interval_ns: int) -> None:
        """Take the interval between two frames that followed one another [ns]."""
        recent, ordered = self._recent, self._sorted
        if len(recent) == WINDOW:
            del ordered[bisect_left(ordered, recent.popleft())]
        recent.append(interval_ns)
        insort(ordered, interval_ns)
        count = len(ordered)
        self.period_ns = median = ordered[count // 2]
        if count >= _ENOUGH:
            self.earliest_ns = max(2 * ordered[0] - median - 4 * median // count**2, 0)
