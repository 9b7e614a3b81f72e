"""A capture device's identity, and the formats, sizes and rates it offers."""

import errno
from collections.abc import Callable, Iterator
from ctypes import Structure
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from vergence_camera.errors import UnsupportedError
from vergence_camera.v4l2 import structures as v4l2
from vergence_camera.v4l2.faults import camera_error
from vergence_camera.v4l2.kernel import Kernel

Answer = TypeVar("Answer", bound=Structure)


@dataclass(frozen=True)
class OfferedSize:
    """One size of one pixel format; `rates_hz` from fast to slow, empty where the driver lists none."""

    pixel_format: str
    width_px: int
    height_px: int
    rates_hz: tuple[float, ...]

    def __str__(self) -> str:
        rates = "/".join(f"{rate:g}" for rate in self.rates_hz) or "?"
        return f"{self.pixel_format} {self.width_px}x{self.height_px} at {rates} Hz"


@dataclass(frozen=True)
class CaptureDevice:
    """The result of QUERYCAP for a device that can stream."""

    driver: str
    card: str
    bus: str


def query_capture(kernel: Kernel, descriptor: int, path: str) -> CaptureDevice:
    """Return what the device is; raise UnsupportedError unless it is a camera that can stream."""
    answer = v4l2.Capability()
    try:
        kernel.ioctl(descriptor, v4l2.QUERYCAP, answer)
    except OSError as error:
        raise camera_error(error, "asking what it is", path) from error
    capabilities = answer.device_caps if answer.capabilities & v4l2.CAP_DEVICE_CAPS else answer.capabilities
    wanted = v4l2.CAP_VIDEO_CAPTURE | v4l2.CAP_STREAMING
    if capabilities & wanted != wanted:
        raise UnsupportedError(f"{path}: '{_text(answer.card)}' is no capture device (but a metadata or output device)")
    return CaptureDevice(_text(answer.driver), _text(answer.card), _text(answer.bus_info))


def offered_sizes(kernel: Kernel, descriptor: int) -> list[OfferedSize]:
    """Return every discrete size of every format; a stepwise range is given by its largest size."""
    offered = []
    for description in _enumerate(kernel, descriptor, v4l2.ENUM_FMT, _format_query):
        code = description.pixelformat
        for size in _enumerate(kernel, descriptor, v4l2.ENUM_FRAMESIZES, partial(_size_query, code)):
            discrete = size.type == v4l2.DISCRETE
            width, height = (size.bounds[0], size.bounds[1]) if discrete else (size.bounds[1], size.bounds[4])
            rates = _rates(kernel, descriptor, code, width, height)
            offered.append(OfferedSize(v4l2.fourcc_text(code), width, height, rates))
            if not discrete:
                break
    return offered


def _rates(kernel: Kernel, descriptor: int, code: int, width: int, height: int) -> tuple[float, ...]:
    def query(index: int) -> v4l2.FrameInterval:
        return v4l2.FrameInterval(index=index, pixel_format=code, width=width, height=height)

    rates = set()
    for answer in _enumerate(kernel, descriptor, v4l2.ENUM_FRAMEINTERVALS, query):
        for interval in answer.intervals[: 1 if answer.type == v4l2.DISCRETE else 2]:
            if interval.numerator:
                rates.add(round(interval.denominator / interval.numerator, 3))
        if answer.type != v4l2.DISCRETE:
            break
    return tuple(sorted(rates, reverse=True))


def _format_query(index: int) -> v4l2.FormatDescription:
    return v4l2.FormatDescription(index=index, type=v4l2.CAPTURE)


def _size_query(code: int, index: int) -> v4l2.FrameSize:
    return v4l2.FrameSize(index=index, pixel_format=code)


def _enumerate(kernel: Kernel, descriptor: int, request: int, query: Callable[[int], Answer]) -> Iterator[Answer]:
    for index in range(256):
        answer = query(index)
        try:
            kernel.ioctl(descriptor, request, answer)
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.ENOTTY):
                return
            raise
        yield answer


def _text(value: bytes) -> str:
    return value.decode("utf-8", "replace")
