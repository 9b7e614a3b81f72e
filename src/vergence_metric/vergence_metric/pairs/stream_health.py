"""What a stream of images says about itself: rate, age, refusals, and one sentence on what is wrong."""

from collections import deque
from dataclasses import dataclass, field
from statistics import median

_RECENT = 90


@dataclass(frozen=True)
class Finding:
    """`fine`, one sentence, and figures by name."""

    fine: bool
    sentence: str
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

    def accept(self, now_s: float, age_s: float, size_px: tuple[int, int]) -> None:
        """Take a usable image of (width, height)."""
        self.looked_into(size_px)
        self.pass_over(now_s, age_s)

    def looked_into(self, size_px: tuple[int, int]) -> None:
        """Take note that an image was good and of (width, height)."""
        self.size_px = size_px
        self._refusal = None

    def pass_over(self, now_s: float, age_s: float) -> None:
        """Take an image that nobody looked into."""
        if now_s - self._last_s > 1.0:
            self._arrivals_s.clear()  # a rate over a gap says nothing
        self.received += 1
        self._last_s = now_s
        self._arrivals_s.append(now_s)
        self._ages_s.append(age_s)

    def refuse(self, now_s: float, reason: str) -> None:
        """Take an image that cannot be used."""
        self.received += 1
        self._last_s = now_s
        self._refusal = reason
        self.refused += 1

    @property
    def rate_hz(self) -> float | None:
        """Usable images per second of late."""
        if len(self._arrivals_s) < 2:
            return None
        passed_s = self._arrivals_s[-1] - self._arrivals_s[0]
        return (len(self._arrivals_s) - 1) / passed_s if passed_s > 0 else None

    def finding(self, now_s: float, publishers: int, stalled_after_s: float) -> Finding:
        """Return how the stream is at `now_s` with that many publishers on its topic."""
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
            why = "" if publishers else " (nobody publishes it)"
            sentence = f"{self.topic}: no image {since} {silent_s:.1f} s{why}"
            return Finding(not self.received and silent_s <= stalled_after_s, sentence, values)
        if self._refusal is not None:
            return Finding(False, f"{self.topic}: {self._refusal}", values | {"publishers": publishers})
        if publishers > 1:
            return Finding(False, f"{self.topic}: {publishers} publishers, there must be one", values)
        return Finding(True, f"{self.topic}: {self.rate_hz or 0.0:.1f} Hz", values)
