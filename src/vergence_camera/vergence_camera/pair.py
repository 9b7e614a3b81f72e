"""Checks of two cameras as a pair: USB controllers, rates, controls, and the time between their frames."""

import bisect
import math
import statistics
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

_WINDOW = 60


@dataclass(frozen=True)
class EyeCamera:
    """One camera of the pair; empty or NaN where a value is missing. `controls` must be equal in both cameras."""

    name: str
    controller: str = ""
    rate_hz: float = math.nan
    controls: Mapping[str, object] = field(default_factory=dict)


def faults_of_pair(left: EyeCamera, right: EyeCamera, skew_s: float, max_skew_s: float) -> list[str]:
    """Return a sentence "problem: remedy" for each fault of the pair."""
    faults = []
    if left.controller and left.controller == right.controller:
        faults.append(
            f"{left.name} and {right.name} share USB controller {left.controller}: plug one into a port of another "
            "controller if frames are lost or the second does not start"
        )
    rates = (left.rate_hz, right.rate_hz)
    if all(math.isfinite(rate) for rate in rates) and max(rates) > 1.05 * min(rates):
        faults.append(
            f"{left.name} runs at {left.rate_hz:.1f} Hz, {right.name} at {right.rate_hz:.1f} Hz: set the same "
            "rate_hz, and fix the exposure, which a dim room makes longer than a frame (lock: hold)"
        )
    differing = [
        f"{name} {left.controls[name]} and {right.controls[name]}"
        for name in left.controls
        if name in right.controls and not _equal_enough(left.controls[name], right.controls[name])
    ]
    if differing:
        faults.append(f"the cameras differ in {', '.join(differing)}: set lock 'hold' on one and 'follow' on the other")
    if math.isfinite(skew_s) and abs(skew_s) > max_skew_s:
        faults.append(
            f"the cameras are {abs(skew_s) * 1e3:.1f} ms apart, at most {max_skew_s * 1e3:.1f} ms are paired: restart "
            "one, use a higher rate, or measure stamp_offset_s"
        )
    return faults


class SkewMeter:
    """Median time between a frame of one eye and the nearest of the other, from their stamps."""

    def __init__(self) -> None:
        self._own: deque[int] = deque(maxlen=_WINDOW)
        self._other: deque[int] = deque(maxlen=_WINDOW)

    def add_own(self, stamp_ns: int) -> None:
        """Add a stamp of this eye, in order."""
        self._own.append(stamp_ns)

    def add_other(self, stamp_ns: int) -> None:
        """Add a stamp of the other eye, in order."""
        self._other.append(stamp_ns)

    def skew_s(self) -> float:
        """Return the median of own minus nearest other; NaN until the stamps of both overlap."""
        own, other = list(self._own), list(self._other)
        common = [stamp for stamp in own if other and other[0] <= stamp <= other[-1]]
        if not common:
            return math.nan
        return statistics.median(stamp - _nearest(other, stamp) for stamp in common) * 1e-9

    def other_rate_hz(self) -> float:
        """Return the other eye's rate by its stamps; NaN before the second stamp."""
        other = list(self._other)
        span = other[-1] - other[0] if len(other) > 1 else 0
        return (len(other) - 1) * 1e9 / span if span > 0 else math.nan


def _nearest(ordered: list[int], value: int) -> int:
    right = bisect.bisect_left(ordered, value)
    return min(ordered[max(0, right - 1) : right + 1], key=lambda candidate: abs(candidate - value))


def _equal_enough(one: object, other: object) -> bool:
    if isinstance(one, int) and isinstance(other, int) and not isinstance(one, bool):
        return abs(one - other) <= 0.02 * max(abs(one), abs(other))
    return one == other
