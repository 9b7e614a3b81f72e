"""Which images of both eyes are sent: those of one moment together, and no more than a rate allows."""

from dataclasses import dataclass
from typing import Any

_SLOP_NS = 25_000_000
"""Two eyes' images are of one moment if their stamps differ by no more."""
_EARLY = 0.9
"""Share of the period after which the next image is taken: rates of images and pages are no multiples."""


@dataclass(frozen=True)
class EyeFrame:
    """One eye's image as it arrived: its message and stamp [ns]."""

    message: Any
    stamp_ns: int


class EyePair:
    """Keeps the newest image of each eye until both, or one of a lone eye, are due. Eyes are "left" and "right"."""

    def __init__(self) -> None:
        self._waiting: dict[str, EyeFrame] = {}
        self._sent_s = float("-inf")

    def add(self, eye: str, frame: EyeFrame, now_s: float, rate_hz: float) -> dict[str, EyeFrame]:
        """Return the images that are due with this one: those of both eyes at one moment, or none."""
        due = now_s - self._sent_s >= _EARLY / rate_hz
        other = self._waiting.get("right" if eye == "left" else "left")
        together = other is not None and abs(other.stamp_ns - frame.stamp_ns) <= _SLOP_NS
        if due or together:
            self._waiting[eye] = frame
        return self._pop(now_s) if together else {}

    def lone(self, now_s: float, wait_s: float) -> dict[str, EyeFrame]:
        """Return what has waited for longer than `wait_s` since the last images: the other eye's do not come."""
        return self._pop(now_s) if self._waiting and now_s - self._sent_s > wait_s else {}

    def _pop(self, now_s: float) -> dict[str, EyeFrame]:
        found, self._waiting, self._sent_s = self._waiting, {}, now_s
        return found
