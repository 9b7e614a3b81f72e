"""Streaming from a V4L2 device by memory-mapped buffers.

Own ioctls rather than OpenCV's capture, because then
- the camera's JPEG comes out of the driver's buffer untouched with one copy;
- the kernel's stamp comes with its clock, and its sequence counts the frames that the driver dropped;
- a stall is detected after any time-out and not after OpenCV's ten seconds;
- the errno explains a failure.
"""

import contextlib
from collections.abc import Callable, Sequence
from ctypes import Structure
from typing import Protocol

from vergence_camera.errors import CameraError, CorruptFrameError, ModeMismatchError, WrongSizeError
from vergence_camera.frame import Clock, Encoding, Frame, Mode, ModeRequest
from vergence_camera.jpeg import inspect_jpeg
from vergence_camera.v4l2 import structures as v4l2
from vergence_camera.v4l2.faults import camera_error
from vergence_camera.v4l2.formats import offered_sizes, query_capture
from vergence_camera.v4l2.kernel import Kernel, MappedBuffer

_ENCODINGS = {"MJPG": Encoding.JPEG, "JPEG": Encoding.JPEG, "YUYV": Encoding.YUYV, "GREY": Encoding.GREY}
READABLE_FORMATS = tuple(_ENCODINGS)
_LONGEST_AGE_NS = 10_000_000_000


class DeviceUser(Protocol):
    """Another user of the open device: its controls."""

    def attach(self, kernel: Kernel, descriptor: int, path: str) -> None:
        """The device is open and has its mode; called before every start of the stream."""
        ...

    def detach(self) -> None:
        """The descriptor is about to be closed and must not be used again."""
        ...


class V4l2Source:
    """A FrameSource for one V4L2 device.

    `resolve` returns the device's present path: it is called at every `open`, so that a camera which was reconnected
    under another number is found. `user` is called at every opening and closing.
    """

    def __init__(
        self,
        kernel: Kernel,
        resolve: Callable[[], str],
        identity: str,
        request: ModeRequest,
        *,
        buffers: int = 4,
        must_be_whole: bool = True,
        user: DeviceUser | None = None,
    ) -> None:
        self._kernel, self._resolve, self._request = kernel, resolve, request
        self._identity, self._must_be_whole, self._wanted_buffers = identity, must_be_whole, buffers
        self._user = user
        self._descriptor: int | None = None
        self._path = ""
        self._buffers: list[MappedBuffer] = []
        self._mode = Mode("", 0, 0, 0.0)
        self._encoding = Encoding.JPEG
        self._row_bytes = 0

    @property
    def identity(self) -> str:
        """See FrameSource."""
        return self._identity

    def open(self) -> Mode:
        """See FrameSource."""
        self.close()
        self._path = self._resolve()
        try:
            self._descriptor = self._kernel.open(self._path)
        except OSError as error:
            raise camera_error(error, "opening it", self._path) from error
        try:
            query_capture(self._kernel, self._descriptor, self._path)
            self._mode = self._set_mode()
            if self._user is not None:
                self._user.attach(self._kernel, self._descriptor, self._path)
            self._start()
        except BaseException:
            self.close()
            raise
        return self._mode

    def read(self, timeout_s: float) -> Frame | None:
        """See FrameSource. Of several buffers that are ready only the newest is returned."""
        if self._descriptor is None:
            raise CameraError(f"{self._identity}: read before open")
        if not self._kernel.wait(self._descriptor, timeout_s):
            return None
        newest, skipped = self._dequeue(), 0
        if newest is None:
            return None
        while (newer := self._dequeue()) is not None:
            self._queue(newest.index)
            newest, skipped = newer, skipped + 1
        data = self._buffers[newest.index][: newest.bytesused]
        self._queue(newest.index)
        return self._frame(newest, bytes(data), skipped)

    def close(self) -> None:
        """See FrameSource."""
        descriptor, self._descriptor = self._descriptor, None
        buffers, self._buffers = self._buffers, []
        if descriptor is None:
            return
        if self._user is not None:
            self._user.detach()
        with contextlib.suppress(OSError):
            self._kernel.ioctl(descriptor, v4l2.STREAMOFF, v4l2.BufferType(v4l2.CAPTURE))
        for buffer in buffers:
            buffer.close()
        with contextlib.suppress(OSError):
            self._kernel.close(descriptor)

    def _ioctl(self, doing: str, request: int, argument: Structure) -> None:
        assert self._descriptor is not None
        try:
            self._kernel.ioctl(self._descriptor, request, argument)
        except OSError as error:
            raise camera_error(error, doing, self._path) from error

    def _set_mode(self) -> Mode:
        current = v4l2.Format(type=v4l2.CAPTURE)
        self._ioctl("asking for its format", v4l2.G_FMT, current)
        pixels = current.fmt.pix
        pixels.width = self._request.width_px or pixels.width
        pixels.height = self._request.height_px or pixels.height
        if self._request.pixel_format:
            pixels.pixelformat = v4l2.fourcc(self._request.pixel_format)
        pixels.field = v4l2.FIELD_NONE
        pixels.bytesperline = pixels.sizeimage = 0
        self._ioctl(f"setting {self._request}", v4l2.S_FMT, current)
        rate_hz = self._set_rate()
        mode = Mode(v4l2.fourcc_text(pixels.pixelformat), pixels.width, pixels.height, rate_hz)
        if self._request.hard_mismatch(mode) or mode.pixel_format not in _ENCODINGS:
            raise ModeMismatchError(
                f"{self._path}: requested {self._request}, the camera gives {mode}; it offers {self._offers()}"
            )
        self._encoding, self._row_bytes = _ENCODINGS[mode.pixel_format], pixels.bytesperline
        return mode

    def _set_rate(self) -> float:
        """Request the rate, and return the one that the driver has chosen (0 where it reports none)."""
        parameters = v4l2.StreamParameters(type=v4l2.CAPTURE)
        try:
            self._ioctl("asking for its rate", v4l2.G_PARM, parameters)
            capture = parameters.parm.capture
            if self._request.rate_hz and capture.capability & v4l2.CAP_TIMEPERFRAME:
                capture.timeperframe = v4l2.Fraction(1000, round(self._request.rate_hz * 1000))
                self._ioctl("setting its rate", v4l2.S_PARM, parameters)
        except CameraError as error:
            if error.permanent:  # a driver without rates
                return 0.0
            raise
        interval = parameters.parm.capture.timeperframe
        return round(interval.denominator / interval.numerator, 3) if interval.numerator else 0.0

    def _offers(self) -> str:
        assert self._descriptor is not None
        sizes: Sequence[object] = offered_sizes(self._kernel, self._descriptor)
        return "; ".join(str(size) for size in sizes) or "no listed mode"

    def _start(self) -> None:
        assert self._descriptor is not None
        request = v4l2.RequestBuffers(count=self._wanted_buffers, type=v4l2.CAPTURE, memory=v4l2.MMAP)
        self._ioctl("asking for buffers", v4l2.REQBUFS, request)
        for index in range(request.count):
            buffer = v4l2.Buffer(index=index, type=v4l2.CAPTURE, memory=v4l2.MMAP)
            self._ioctl("asking for a buffer", v4l2.QUERYBUF, buffer)
            try:
                self._buffers.append(self._kernel.map(self._descriptor, buffer.length, buffer.m.offset))
            except OSError as error:
                raise camera_error(error, "mapping a buffer", self._path) from error
            self._queue(index)
        self._ioctl("starting the stream", v4l2.STREAMON, v4l2.BufferType(v4l2.CAPTURE))

    def _queue(self, index: int) -> None:
        self._ioctl("queuing a buffer", v4l2.QBUF, v4l2.Buffer(index=index, type=v4l2.CAPTURE, memory=v4l2.MMAP))

    def _dequeue(self) -> v4l2.Buffer | None:
        assert self._descriptor is not None
        buffer = v4l2.Buffer(type=v4l2.CAPTURE, memory=v4l2.MMAP)
        try:
            self._kernel.ioctl(self._descriptor, v4l2.DQBUF, buffer)
        except BlockingIOError:
            return None
        except OSError as error:
            raise camera_error(error, "dequeuing a frame", self._path) from error
        return buffer

    def _frame(self, buffer: v4l2.Buffer, data: bytes, skipped: int) -> Frame:
        if buffer.flags & v4l2.BUFFER_ERROR:
            raise CorruptFrameError(f"{self._path}: the driver marks frame {buffer.sequence} as damaged")
        time_ns, clock = _capture_time(buffer)
        width, height = self._mode.width_px, self._mode.height_px
        if self._encoding is Encoding.JPEG:
            info = inspect_jpeg(data, must_be_whole=self._must_be_whole)
            if (info.width_px, info.height_px) != (width, height):
                raise WrongSizeError(
                    f"{self._path}: frame of {info.width_px}x{info.height_px}, the stream has {width}x{height}"
                )
        else:
            data = self._rows(data)
        return Frame(data, self._encoding, width, height, time_ns, clock, buffer.sequence, skipped)

    def _rows(self, data: bytes) -> bytes:
        """Return the rows without the driver's padding."""
        wanted = self._mode.width_px * (2 if self._encoding is Encoding.YUYV else 1)
        stride = max(self._row_bytes, wanted)
        if len(data) < stride * (self._mode.height_px - 1) + wanted:
            raise CorruptFrameError(
                f"{self._path}: frame must have {stride * self._mode.height_px} bytes: got {len(data)}"
            )
        if stride == wanted:
            return data[: wanted * self._mode.height_px]
        return b"".join(data[row * stride : row * stride + wanted] for row in range(self._mode.height_px))


def _capture_time(buffer: v4l2.Buffer) -> tuple[int, Clock]:
    """Return the kernel's stamp and its clock; where the driver does not report the clock, the stamp's age decides."""
    stamp_ns = (buffer.timestamp.seconds * 1_000_000 + buffer.timestamp.microseconds) * 1000
    if buffer.flags & v4l2.TIMESTAMP_MASK == v4l2.TIMESTAMP_MONOTONIC:
        return stamp_ns, Clock.MONOTONIC
    for clock in (Clock.WALL, Clock.MONOTONIC):
        if 0 <= clock.now_ns() - stamp_ns < _LONGEST_AGE_NS:
            return stamp_ns, clock
    return Clock.MONOTONIC.now_ns(), Clock.MONOTONIC
