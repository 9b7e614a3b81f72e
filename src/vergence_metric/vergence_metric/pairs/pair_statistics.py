"""Statistics of pairing two streams: counts, skew, and one sentence where frames do not pair."""

from collections import deque
from statistics import median

_RECENT = 128
_COMPLAIN_AFTER = 8


class PairStatistics:
    """Counts since the start, and recent skews. Index 0 is the left stream, 1 the right one."""

    def __init__(self) -> None:
        self.pairs = 0
        """Pairs released."""
        self.received = [0, 0]
        """Frames received."""
        self.unmatched = [0, 0]
        """Frames dropped without a partner."""
        self.late = [0, 0]
        """Frames refused because their stamp is not later than their predecessor's."""
        self.resets = 0
        """Number of times that pairing restarted because the stamps jumped."""
        self._skews_ns: deque[int] = deque(maxlen=_RECENT)
        self._misses_ns: deque[int] = deque(maxlen=_RECENT)

    def matched(self, skew_ns: int) -> None:
        """Count a pair with its skew, right stamp less left [ns]."""
        self.pairs += 1
        self._skews_ns.append(skew_ns)
        self._misses_ns.clear()

    def missed(self, side: int, skew_ns: int | None) -> None:
        """Count a frame dropped without a partner, with its distance from the nearest frame [ns], None without one."""
        self.unmatched[side] += 1
        if skew_ns is not None:
            self._misses_ns.append(skew_ns)

    @property
    def skew_median_s(self) -> float | None:
        """Median of the latest pairs' signed skews [s]."""
        return median(self._skews_ns) * 1e-9 if self._skews_ns else None

    @property
    def skew_largest_s(self) -> float | None:
        """Largest size of the latest pairs' skews [s]."""
        return max(map(abs, self._skews_ns)) * 1e-9 if self._skews_ns else None

    def complaint(self, slop_s: float) -> str | None:
        """Return why frames of both eyes make no pairs; None while they do, or while one stream has no frames."""
        if len(self._misses_ns) < _COMPLAIN_AFTER:
            return None
        when = "since the start" if self.pairs == 0 else f"for {len(self._misses_ns)} frames"
        skew_ms = median(self._misses_ns) * 1e-6
        return f"no pair {when}: median skew is {skew_ms:.0f} ms, pair.slop_s allows {slop_s * 1e3:.3g} ms"
