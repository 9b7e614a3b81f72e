"""Health of a stream of images: rate, age, images refused, and one sentence of status."""

import math
from collections import deque
from dataclasses import dataclass, field
from statistics import median

_RECENT = 90
LEAST_RATE_HZ = 5.0
"""Rate by the stamps below which nothing can be followed or paired in time [Hz]."""
_SLOW_INTERVALS, _FEW = 2, 3
_STAMPS = 20
_AGE_S = (-0.25, 1.0)


@dataclass(frozen=True)
class StreamStatus:
    """Whether a stream is in order, one sentence, and figures by name."""

    ok: bool
    message: str
    values: dict[str, object] = field(default_factory=dict)


class StreamHealth:
    """Counts one topic's images. Times are of one steady clock [s], ages are arrival less stamp [s]."""

    def __init__(self, topic: str, now_s: float) -> None:
        self.topic = topic
        self.received = 0
        self.size_px: tuple[int, int] | None = None
        self.refused = 0
        self._refusal: str | None = None
        self._last_s = self._started_s = now_s
        self._arrivals_s: deque[float] = deque(maxlen=_RECENT)
        self._ages_s: deque[float] = deque(maxlen=_RECENT)
        self._stamp_s = math.nan
        self._intervals_s: deque[float] = deque(maxlen=_STAMPS)

    def accept(self, now_s: float, age_s: float, size_px: tuple[int, int], stamp_s: float = math.nan) -> None:
        """Count a usable image of (width, height)."""
        self.decoded(size_px)
        self.count(now_s, age_s, stamp_s)

    def decoded(self, size_px: tuple[int, int]) -> None:
        """Record that a counted image could be decoded, and its (width, height)."""
        self.size_px = size_px
        self._refusal = None

    def count(self, now_s: float, age_s: float, stamp_s: float = math.nan) -> None:
        """Count an image that has arrived, decoded or not, with its stamp on the clock of the images [s]."""
        if now_s - self._last_s > 1.0:
            self._arrivals_s.clear()  # no rate over a gap
            self._ages_s.clear()
        if math.isfinite(stamp_s - self._stamp_s):
            self._intervals_s.append(stamp_s - self._stamp_s)
        self._stamp_s = stamp_s
        self.received += 1
        self._last_s = now_s
        self._arrivals_s.append(now_s)
        self._ages_s.append(age_s)

    def refuse(self, now_s: float, reason: str) -> None:
        """Count an image that cannot be used, and why."""
        self.received += 1
        self._last_s = now_s
        self._refusal = reason
        self.refused += 1

    @property
    def rate_hz(self) -> float | None:
        """Recent usable images per second."""
        if len(self._arrivals_s) < 2:
            return None
        passed_s = self._arrivals_s[-1] - self._arrivals_s[0]
        return (len(self._arrivals_s) - 1) / passed_s if passed_s > 0 else None

    def status(self, now_s: float, publishers: int, stalled_after_s: float) -> StreamStatus:
        """Return the status at `now_s`, with that many publishers on the topic."""
        values: dict[str, object] = {"received": self.received, "refused": self.refused}
        if self.rate_hz is not None:
            values["rate_hz"] = self.rate_hz
        if self._ages_s:
            values["age_median_ms"] = median(self._ages_s) * 1e3
        if self.size_px is not None:
            values["size_px"] = f"{self.size_px[0]}x{self.size_px[1]}"
        silent_s = now_s - self._last_s
        if silent_s > stalled_after_s or not self.received:
            since = "for" if self.received else "since the start,"
            silent_s = silent_s if self.received else now_s - self._started_s
            why = "" if publishers else " (the topic has no publisher)"
            message = f"{self.topic}: no image {since} {silent_s:.1f} s{why}"
            return StreamStatus(not self.received and silent_s <= stalled_after_s, message, values)
        if self._refusal is not None:
            return StreamStatus(False, f"{self.topic}: {self._refusal}", values | {"publishers": publishers})
        if publishers > 1:
            return StreamStatus(False, f"{self.topic} must have one publisher: got {publishers}", values)
        fault = self._fault_of_stamps()
        if fault:
            return StreamStatus(False, f"{self.topic}: {fault}", values)
        return StreamStatus(True, f"{self.topic}: {self.rate_hz or 0.0:.1f} Hz", values)

    def _fault_of_stamps(self) -> str:
        """Return what is wrong with the stamps, "" if nothing is."""
        intervals_s = list(self._intervals_s)
        stuck = sum(interval_s <= 0 for interval_s in intervals_s)
        if len(intervals_s) >= _FEW and 2 * stuck > len(intervals_s):
            what = "they are zero" if self._stamp_s == 0 else f"{stuck} of the last {len(intervals_s)} do not"
            return f"stamps must increase from image to image: {what}"
        if len(intervals_s) >= _SLOW_INTERVALS:
            interval_s = min(intervals_s[-_SLOW_INTERVALS:])
            if interval_s > 1.0 / LEAST_RATE_HZ:
                return f"the camera is slower than needed: {1 / interval_s:.1f} Hz, at least {LEAST_RATE_HZ:g} Hz"
        if len(self._ages_s) >= _FEW:
            age_s = median(list(self._ages_s)[-_STAMPS:])
            if not _AGE_S[0] <= age_s <= _AGE_S[1]:
                late = f"{age_s:.3g} s old" if age_s > 0 else f"{-age_s:.3g} s ahead of the clock"
                return f"by their stamps images are {late}: the camera's and this node's clocks or use_sim_time differ"
        return ""
