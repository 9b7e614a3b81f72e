"""Health of a stream of images: rate, age, images refused, and one sentence of status."""

from collections import deque
from dataclasses import dataclass, field
from statistics import median

_RECENT = 90


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

    def accept(self, now_s: float, age_s: float, size_px: tuple[int, int]) -> None:
        """Count a usable image of (width, height)."""
        self.decoded(size_px)
        self.count(now_s, age_s)

    def decoded(self, size_px: tuple[int, int]) -> None:
        """Record that a counted image could be decoded, and its (width, height)."""
        self.size_px = size_px
        self._refusal = None

    def count(self, now_s: float, age_s: float) -> None:
        """Count an image that has arrived, decoded or not."""
        if now_s - self._last_s > 1.0:
            self._arrivals_s.clear()  # no rate over a gap
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
        return StreamStatus(True, f"{self.topic}: {self.rate_hz or 0.0:.1f} Hz", values)
