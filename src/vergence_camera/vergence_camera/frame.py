"""What a source delivers: the unchanged bytes of a frame, its capture time and the clock of that time."""

import time
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[np.uint8]


class Clock(Enum):
    """The clock that a capture time was read from; `now_ns()` is its reading now, in nanoseconds."""

    MONOTONIC = "monotonic"
    WALL = "wall"

    def __init__(self, name: str) -> None:
        self.now_ns = time.monotonic_ns if name == "monotonic" else time.time_ns


class Encoding(Enum):
    """How a frame's data is to be read."""

    JPEG = "jpeg"
    BGR = "bgr8"
    GREY = "mono8"
    YUYV = "yuyv"


class Frame(NamedTuple):
    """One frame, untouched.

    `data` is the camera's own bytes for JPEG and YUYV, and uint8 pixels (h, w, 3) or (h, w) for BGR and GREY.
    `time_ns` is the capture time on `clock`. `sequence` counts the source's frames: a step of more than one means that
    frames were lost before they reached this process. `skipped` older frames were dropped for this newer one.
    """

    data: bytes | Pixels
    encoding: Encoding
    width_px: int
    height_px: int
    time_ns: int
    clock: Clock
    sequence: int
    skipped: int = 0


@dataclass(frozen=True)
class Mode:
    """What a source delivers: `pixel_format` is the four-character code of the stream (MJPG, YUYV, H264, ...)."""

    pixel_format: str
    width_px: int
    height_px: int
    rate_hz: float

    def __str__(self) -> str:
        rate = f"{self.rate_hz:g} Hz" if self.rate_hz else "unknown rate"
        return f"{self.pixel_format} {self.width_px}x{self.height_px} at {rate}"


@dataclass(frozen=True)
class ModeRequest:
    """The requested mode; zero or an empty text accepts any."""

    pixel_format: str = ""
    width_px: int = 0
    height_px: int = 0
    rate_hz: float = 0.0

    def __str__(self) -> str:
        size = f"{self.width_px or 'any'}x{self.height_px or 'any'}"
        rate = f"{self.rate_hz:g} Hz" if self.rate_hz else "any rate"
        return f"{self.pixel_format or 'any format'} {size} at {rate}"

    def hard_mismatch(self, actual: Mode) -> bool:
        """True if size or pixel format differ from the request: an error."""
        return (
            (self.pixel_format not in ("", actual.pixel_format))
            or (self.width_px not in (0, actual.width_px))
            or (self.height_px not in (0, actual.height_px))
        )

    def soft_mismatch(self, actual: Mode) -> bool:
        """True if the rate differs by more than 2 %: a warning."""
        if not self.rate_hz or not actual.rate_hz:
            return False
        return abs(actual.rate_hz - self.rate_hz) > 0.02 * self.rate_hz


class FrameSource(Protocol):
    """A camera, file or stream. One thread uses it; `open` after `close` starts afresh."""

    @property
    def identity(self) -> str:
        """What is opened, in words that stay the same over a reconnect."""
        ...

    def open(self) -> Mode:
        """Start the stream and return its mode; on failure everything is released and a CameraError raised."""
        ...

    def read(self, timeout_s: float) -> Frame | None:
        """Return the newest frame, or None if none came within `timeout_s`; raise CameraError on a fault."""
        ...

    def close(self) -> None:
        """Release everything; harmless when nothing is open."""
        ...
