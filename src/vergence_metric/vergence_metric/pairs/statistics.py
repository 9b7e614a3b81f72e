"""What became of the frames of two streams: counts, skew, and one sentence when they do not pair."""

from collections import deque
from statistics import median

_RECENT = 128
_SPEAK_AFTER = 8


class PairStatistics:
    """Counts since the start and the skews of late. Index 0 is the left stream, 1 the right one."""

    def __init__(self) -> None:
        self.pairs = 0
        """Pairs given out."""
        self.received = [0, 0]
        """Frames that came."""
        self.unmatched = [0, 0]
        """Frames dropped without a partner."""
        self.late = [0, 0]
        """Frames refused because their stamp does not follow their predecessor's."""
        self.resets = 0
        """Times at which the stamps jumped and pairing began anew."""
        self._skews_ns: deque[int] = deque(maxlen=_RECENT)
        self._misses_ns: deque[int] = deque(maxlen=_RECENT)

    def matched(self, skew_ns: int) -> None:
        """Take the skew of a pair, right stamp less left [ns]."""
        self.pairs += 1
        self._skews_ns.append(skew_ns)
        self._misses_ns.clear()

    def missed(self, side: int, skew_ns: int | None) -> None:
        """Take a frame dropped without a partner and how far the nearest was [ns], None if there was none."""
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
        """Return why frames of both eyes come and make no pairs; None while they do, or while one eye is silent."""
        if len(self._misses_ns) < _SPEAK_AFTER:
            return None
        when = "never" if self.pairs == 0 else f"for {len(self._misses_ns)} frames not"
        skew_ms = median(self._misses_ns) * 1e-6
        return f"{when} within slop: median skew {skew_ms:.0f} ms, pair_slop_s allows {slop_s * 1e3:.3g} ms"
