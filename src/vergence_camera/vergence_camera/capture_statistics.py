"""Counts and rates of one camera's stream; written by the capture thread, read by diagnostics."""

import statistics
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field

from vergence_camera.errors import CameraError
from vergence_camera.frame import Mode

_WINDOW = 150


@dataclass(frozen=True)
class CaptureSnapshot:
    """The state at one moment. Times are in seconds; NaN before the first measurement.

    `unpublished_s` is the time since a frame went out, or since the stream began.
    """

    connected: bool
    ended: bool
    mode: Mode | None
    frames: int
    rate_hz: float
    age_s: float
    stamp_to_publish_s: float
    dropped_by_driver: int
    skipped: int
    too_old: int
    corrupt: int
    reconnects: int
    faults: dict[str, int]
    last_fault: str
    unpublished_s: float = 0.0

    def values(self) -> dict[str, object]:
        """Return the values by name, for a diagnostic."""
        return {
            "frames": self.frames,
            "rate_hz": round(self.rate_hz, 2),
            "age_s": round(self.age_s, 4),
            "stamp_to_publish_ms": round(self.stamp_to_publish_s * 1e3, 3),
            "dropped_by_driver": self.dropped_by_driver,
            "dropped_for_newer": self.skipped,
            "dropped_too_old": self.too_old,
            "dropped_corrupt": self.corrupt,
            "reconnects": self.reconnects,
            **{f"fault.{kind}": count for kind, count in sorted(self.faults.items())},
            "last_fault": self.last_fault or "none",
        }


@dataclass
class _Counts:
    frames: int = 0
    dropped_by_driver: int = 0
    skipped: int = 0
    too_old: int = 0
    corrupt: int = 0
    reconnects: int = 0
    faults: Counter[str] = field(default_factory=Counter)


class CaptureStatistics:
    """Counters that one thread writes and any may read. `now_s` is a steady clock."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._counts = _Counts()
        self._arrivals_s: deque[float] = deque(maxlen=_WINDOW)
        self._delays_s: deque[float] = deque(maxlen=_WINDOW)
        self._mode: Mode | None = None
        self._was_connected = self._connected = self._ended = False
        self._last_fault = ""
        self._expected: int | None = None
        self._corrupt_since_last = 0
        self._published_s = now_s()

    def connected(self, mode: Mode) -> None:
        """The stream has begun, or begun again."""
        self._counts.reconnects += int(self._was_connected)
        self._mode, self._expected, self._corrupt_since_last = mode, None, 0
        self._was_connected = self._connected = True
        self._arrivals_s.clear()
        self._published_s = self._now_s()

    def fault(self, error: CameraError) -> None:
        """The stream has failed, or could not be begun."""
        self._connected = False
        self._counts.faults[error.kind] += 1
        self._last_fault = str(error)

    def corrupt(self, error: CameraError) -> None:
        """One frame was not whole and has been dropped."""
        self._counts.corrupt += 1
        self._corrupt_since_last += 1
        self._counts.faults[error.kind] += 1
        self._last_fault = str(error)

    def received(self, sequence: int, skipped: int) -> None:
        """A whole frame came; `skipped` older ones were dropped for it."""
        if sequence != self._expected:
            self._counts.skipped += skipped
            if self._expected is not None:
                self._counts.dropped_by_driver += max(0, sequence - self._expected - skipped - self._corrupt_since_last)
        self._expected, self._corrupt_since_last = sequence + 1, 0
        self._arrivals_s.append(self._now_s())

    def too_old(self) -> None:
        """A frame was older than max_age_s and has been dropped."""
        self._counts.too_old += 1

    def published(self, stamp_to_publish_s: float) -> None:
        """A frame has gone out, that long after its stamp."""
        self._counts.frames += 1
        self._published_s = self._now_s()
        self._delays_s.append(stamp_to_publish_s)

    def ended(self) -> None:
        """A recording has been played to its end."""
        self._ended, self._connected = True, False

    def snapshot(self) -> CaptureSnapshot:
        """Return the present state."""
        arrivals, delays_s, counts = list(self._arrivals_s), list(self._delays_s), self._counts
        nan = float("nan")
        span = arrivals[-1] - arrivals[0] if len(arrivals) > 1 else 0.0
        return CaptureSnapshot(
            connected=self._connected,
            ended=self._ended,
            mode=self._mode,
            frames=counts.frames,
            rate_hz=(len(arrivals) - 1) / span if span > 0.0 else nan,
            age_s=self._now_s() - arrivals[-1] if arrivals else nan,
            stamp_to_publish_s=statistics.median(delays_s) if delays_s else nan,
            dropped_by_driver=counts.dropped_by_driver,
            skipped=counts.skipped,
            too_old=counts.too_old,
            corrupt=counts.corrupt,
            reconnects=counts.reconnects,
            faults=dict(counts.faults),
            last_fault=self._last_fault,
            unpublished_s=self._now_s() - self._published_s,
        )
