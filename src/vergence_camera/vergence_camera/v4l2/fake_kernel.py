"""A kernel with webcams in it, at the layer of the ioctls: what the tests use instead of hardware.

It keeps the driver's side of the contract: a format that is not offered becomes the nearest one, one process streams
at a time, a frame without a queued buffer is lost but counted, an automatic control makes its manual one inactive.
"""

import errno
import itertools
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from ctypes import Structure
from dataclasses import dataclass, field
from typing import Any

from vergence_camera.v4l2 import structures as v4l2


@dataclass
class FakeControl:
    """One control of a fake camera. `menu` maps indices to names; `governs` maps a value to CIDs it makes inactive."""

    cid: int
    name: str
    kind: int
    minimum: int
    maximum: int
    step: int
    default: int
    flags: int = 0
    menu: Mapping[int, str] = field(default_factory=dict)
    governs: Mapping[int, tuple[int, ...]] = field(default_factory=dict)
    read_errno: int = 0
    value: int = 0

    def __post_init__(self) -> None:
        self.value = self.default


def webcam_controls() -> list[FakeControl]:
    """Return the controls of a common UVC webcam."""
    exposure, gain, balance = v4l2.CID_EXPOSURE_ABSOLUTE, v4l2.CID_GAIN, v4l2.CID_WHITE_BALANCE_TEMPERATURE
    power = {0: "Disabled", 1: "50 Hz", 2: "60 Hz"}
    modes = {1: "Manual Mode", 3: "Aperture Priority Mode"}
    update = v4l2.FLAG_UPDATE
    return [
        FakeControl(0x00980001, "User Controls", v4l2.CTRL_CLASS, 0, 0, 0, 0, v4l2.FLAG_READ_ONLY),
        FakeControl(0x00980900, "Brightness", v4l2.CTRL_INTEGER, -64, 64, 1, 0),
        FakeControl(
            v4l2.CID_AUTO_WHITE_BALANCE,
            "White Balance, Automatic",
            v4l2.CTRL_BOOLEAN,
            *(0, 1, 1, 1),
            update,
            governs={1: (balance,)},
        ),
        FakeControl(gain, "Gain", v4l2.CTRL_INTEGER, 0, 100, 1, 16),
        FakeControl(0x00980918, "Power Line Frequency", v4l2.CTRL_MENU, 0, 2, 1, 1, menu=power),
        FakeControl(balance, "White Balance Temperature", v4l2.CTRL_INTEGER, 2800, 6500, 10, 4600),
        FakeControl(0x009A0001, "Camera Controls", v4l2.CTRL_CLASS, 0, 0, 0, 0, v4l2.FLAG_READ_ONLY),
        FakeControl(
            v4l2.CID_EXPOSURE_AUTO,
            "Auto Exposure",
            v4l2.CTRL_MENU,
            *(0, 3, 1, 3),
            update,
            menu=modes,
            governs={3: (exposure,)},
        ),
        FakeControl(exposure, "Exposure Time, Absolute", v4l2.CTRL_INTEGER, 3, 2047, 1, 250),
        FakeControl(0x009A090A, "Focus, Absolute", v4l2.CTRL_INTEGER, 0, 250, 5, 0),
        FakeControl(0x009A0910, "Pan, Reset", v4l2.CTRL_BUTTON, 0, 0, 0, 0, v4l2.FLAG_WRITE_ONLY),
    ]


Sizes = Mapping[str, Mapping[tuple[int, int], tuple[int, ...]]]
WEBCAM_SIZES: Sizes = {
    "MJPG": {(640, 480): (30, 15), (1280, 720): (30,), (320, 240): (30,)},
    "YUYV": {(640, 480): (30,), (1280, 720): (10,)},
}


class FakeCamera:
    """One webcam. `push` is a frame arriving from the sensor; the fields ending in `_errno` are faults to inject."""

    def __init__(
        self,
        card: str = "Fake HD Webcam",
        bus: str = "usb-0000:00:14.0-1",
        sizes: Sizes = WEBCAM_SIZES,
        controls: list[FakeControl] | None = None,
    ) -> None:
        self.card, self.bus, self.sizes = card, bus, sizes
        self.controls = {c.cid: c for c in (webcam_controls() if controls is None else controls)}
        self.capabilities = v4l2.CAP_VIDEO_CAPTURE | v4l2.CAP_STREAMING
        self.timestamp_flags = v4l2.TIMESTAMP_MONOTONIC
        self.open_errno = self.stream_errno = self.dequeue_errno = 0
        self.extended_query = True
        self.requests: list[int] = []
        code, by_size = next(iter(sizes.items()))
        (self.width, self.height), rates = next(iter(by_size.items()))
        self.code, self.rate = code, float(rates[0])
        self.plugged, self.streamer = True, 0
        self.sequence = 0
        self.memory: list[bytearray] = []
        self.queued: deque[int] = deque()
        self.filled: deque[v4l2.Buffer] = deque()
        self.changed = threading.Condition()

    def push(self, data: bytes, time_ns: int | None = None, *, damaged: bool = False) -> bool:
        """Let one frame arrive; False if nobody streams or no buffer is free (it is lost, but counted)."""
        with self.changed:
            sequence, self.sequence = self.sequence, self.sequence + 1
            if not self.streamer or not self.queued:
                return False
            index = self.queued.popleft()
            self.memory[index][: len(data)] = data
            monotonic = self.timestamp_flags & v4l2.TIMESTAMP_MASK == v4l2.TIMESTAMP_MONOTONIC
            stamp_us = (time_ns or (time.monotonic_ns() if monotonic else time.time_ns())) // 1000
            buffer = v4l2.Buffer(index=index, type=v4l2.CAPTURE, memory=v4l2.MMAP, bytesused=len(data))
            buffer.sequence = sequence
            buffer.flags = self.timestamp_flags | (v4l2.BUFFER_ERROR if damaged else 0)
            buffer.timestamp = v4l2.TimeValue(*divmod(stamp_us, 1_000_000))
            self.filled.append(buffer)
            self.changed.notify_all()
            return True

    def play(self, frames: Callable[[int], bytes], rate_hz: float) -> Callable[[], None]:
        """Push `frames(0), frames(1), ...` at a rate from a thread of its own; return what stops it."""
        stop = threading.Event()

        def run() -> None:
            started = time.monotonic()
            for number in itertools.count():
                if stop.wait(max(0.0, started + number / rate_hz - time.monotonic())):
                    return
                self.push(frames(number))

        thread = threading.Thread(target=run, name="fake camera", daemon=True)
        thread.start()

        def end() -> None:
            stop.set()
            thread.join()

        return end

    def unplug(self) -> None:
        """Pull the plug: open descriptors answer 'no such device'."""
        with self.changed:
            self.plugged, self.streamer = False, 0
            self.changed.notify_all()

    def plug_in(self) -> None:
        """Put the plug back: the camera has its power-on controls again."""
        with self.changed:
            self.plugged, self.sequence = True, 0
            for control in self.controls.values():
                control.value = control.default


class FakeKernel:
    """See Kernel. `cameras` maps device paths to cameras and may be changed at any time."""

    def __init__(self, cameras: Mapping[str, FakeCamera]) -> None:
        self.cameras = dict(cameras)
        self._open: dict[int, FakeCamera] = {}
        self._descriptors = itertools.count(1000)

    @property
    def open_descriptors(self) -> list[int]:
        """Descriptors that nobody has closed yet."""
        return sorted(self._open)

    def open(self, path: str) -> int:
        """See Kernel."""
        camera = self.cameras.get(path)
        if camera is None or not camera.plugged:
            raise OSError(errno.ENOENT, os.strerror(errno.ENOENT))
        _fail_with(camera.open_errno)
        descriptor = next(self._descriptors)
        self._open[descriptor] = camera
        return descriptor

    def close(self, descriptor: int) -> None:
        """See Kernel."""
        camera = self._open.pop(descriptor)
        if camera.streamer == descriptor:
            camera.streamer = 0

    def ioctl(self, descriptor: int, request: int, argument: Structure) -> None:
        """See Kernel."""
        camera = self._camera(descriptor)
        camera.requests.append(request)
        answer = _ANSWERS.get(request)
        if answer is None:
            raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        with camera.changed:
            answer(camera, descriptor, argument)

    def map(self, descriptor: int, length: int, offset: int) -> "_FakeBuffer":
        """See Kernel."""
        return _FakeBuffer(self._camera(descriptor).memory[offset >> 12], length)

    def wait(self, descriptor: int, timeout_s: float) -> bool:
        """See Kernel."""
        camera = self._open[descriptor]
        with camera.changed:
            ready = camera.changed.wait_for(lambda: camera.filled or not camera.plugged, timeout_s)
        return bool(ready)

    def _camera(self, descriptor: int) -> FakeCamera:
        camera = self._open.get(descriptor)
        if camera is None:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        _fail_with(0 if camera.plugged else errno.ENODEV)
        return camera


class _FakeBuffer:
    def __init__(self, memory: bytearray, length: int) -> None:
        self._memory: bytearray | None = memory
        self._length = length

    def __getitem__(self, part: slice) -> bytes:
        if self._memory is None:
            raise ValueError("read from an unmapped buffer")
        return bytes(self._memory[: self._length][part])

    def close(self) -> None:
        self._memory = None


def _fail_with(number: int) -> None:
    if number:
        raise OSError(number, os.strerror(number))


def _query_capability(camera: FakeCamera, _: int, answer: Any) -> None:
    answer.driver, answer.card, answer.bus_info = b"uvcvideo", camera.card.encode(), camera.bus.encode()
    answer.capabilities = camera.capabilities | v4l2.CAP_DEVICE_CAPS
    answer.device_caps = camera.capabilities


def _enumerate_formats(camera: FakeCamera, _: int, answer: Any) -> None:
    code = _element(list(camera.sizes), answer.index)
    answer.pixelformat, answer.description = v4l2.fourcc(code), code.encode()


def _enumerate_sizes(camera: FakeCamera, _: int, answer: Any) -> None:
    sizes = camera.sizes.get(v4l2.fourcc_text(answer.pixel_format), {})
    answer.type = v4l2.DISCRETE
    answer.bounds[0], answer.bounds[1] = _element(list(sizes), answer.index)


def _enumerate_intervals(camera: FakeCamera, _: int, answer: Any) -> None:
    sizes = camera.sizes.get(v4l2.fourcc_text(answer.pixel_format), {})
    rate = _element(list(sizes.get((answer.width, answer.height), ())), answer.index)
    answer.type = v4l2.DISCRETE
    answer.intervals[0] = v4l2.Fraction(1, rate)


def _element(values: list[Any], index: int) -> Any:
    if index >= len(values):
        _fail_with(errno.EINVAL)
    return values[index]


def _get_format(camera: FakeCamera, _: int, answer: Any) -> None:
    pixels = answer.fmt.pix
    pixels.width, pixels.height, pixels.pixelformat = camera.width, camera.height, v4l2.fourcc(camera.code)
    pixels.bytesperline = 0 if camera.code == "MJPG" else camera.width * (1 if camera.code == "GREY" else 2)
    pixels.sizeimage = camera.width * camera.height * 2


def _set_format(camera: FakeCamera, descriptor: int, answer: Any) -> None:
    if camera.streamer not in (0, descriptor):
        _fail_with(errno.EBUSY)
    pixels = answer.fmt.pix
    code = v4l2.fourcc_text(pixels.pixelformat)
    camera.code = code if code in camera.sizes else next(iter(camera.sizes))
    wanted = pixels.width * pixels.height
    camera.width, camera.height = min(camera.sizes[camera.code], key=lambda size: abs(size[0] * size[1] - wanted))
    camera.rate = float(camera.sizes[camera.code][camera.width, camera.height][0])
    _get_format(camera, descriptor, answer)


def _get_rate(camera: FakeCamera, _: int, answer: Any) -> None:
    capture = answer.parm.capture
    capture.capability = v4l2.CAP_TIMEPERFRAME
    capture.timeperframe = v4l2.Fraction(1000, round(camera.rate * 1000))


def _set_rate(camera: FakeCamera, descriptor: int, answer: Any) -> None:
    interval = answer.parm.capture.timeperframe
    wanted = interval.denominator / interval.numerator
    rates = camera.sizes[camera.code][camera.width, camera.height]
    camera.rate = float(min(rates, key=lambda rate: abs(rate - wanted)))
    _get_rate(camera, descriptor, answer)


def _request_buffers(camera: FakeCamera, descriptor: int, answer: Any) -> None:
    if camera.streamer not in (0, descriptor):
        _fail_with(errno.EBUSY)
    camera.memory = [bytearray(camera.width * camera.height * 2) for _ in range(answer.count)]
    camera.queued.clear()
    camera.filled.clear()


def _query_buffer(camera: FakeCamera, _: int, answer: Any) -> None:
    answer.length, answer.m.offset = len(camera.memory[answer.index]), answer.index << 12


def _queue_buffer(camera: FakeCamera, _: int, answer: Any) -> None:
    camera.queued.append(answer.index)


def _dequeue_buffer(camera: FakeCamera, _: int, answer: Any) -> None:
    _fail_with(camera.dequeue_errno)
    if not camera.filled:
        _fail_with(errno.EAGAIN)
    buffer = camera.filled.popleft()
    for name in ("index", "bytesused", "flags", "timestamp", "sequence"):
        setattr(answer, name, getattr(buffer, name))


def _stream_on(camera: FakeCamera, descriptor: int, _: Any) -> None:
    _fail_with(camera.stream_errno)
    camera.streamer = descriptor


def _stream_off(camera: FakeCamera, _: int, __: Any) -> None:
    camera.streamer = 0
    camera.queued.clear()
    camera.filled.clear()


def _next_control(camera: FakeCamera, cid: int) -> FakeControl:
    if cid & v4l2.FLAG_NEXT_CTRL:
        cid = min((known for known in camera.controls if known > cid & ~v4l2.FLAG_NEXT_CTRL), default=0)
    if cid not in camera.controls:
        _fail_with(errno.EINVAL)
    return camera.controls[cid]


def _query_control(camera: FakeCamera, _: int, answer: Any) -> None:
    if isinstance(answer, v4l2.QueryExtControl) and not camera.extended_query:
        _fail_with(errno.ENOTTY)
    control = _next_control(camera, answer.id)
    inactive = any(control.cid in other.governs.get(other.value, ()) for other in camera.controls.values())
    answer.id, answer.type, answer.name = control.cid, control.kind, control.name.encode()
    answer.minimum, answer.maximum, answer.step = control.minimum, control.maximum, control.step
    answer.default_value = control.default
    answer.flags = control.flags | (v4l2.FLAG_INACTIVE if inactive else 0)


def _query_menu(camera: FakeCamera, _: int, answer: Any) -> None:
    control = _next_control(camera, answer.id)
    if answer.index not in control.menu:
        _fail_with(errno.EINVAL)
    if control.kind == v4l2.CTRL_INTEGER_MENU:
        answer.item.value = int(control.menu[answer.index])
    else:
        answer.item.name = control.menu[answer.index].encode()


def _get_control(camera: FakeCamera, _: int, answer: Any) -> None:
    control = _next_control(camera, answer.id)
    _fail_with(control.read_errno)
    answer.value = control.value


def _set_control(camera: FakeCamera, _: int, answer: Any) -> None:
    control = _next_control(camera, answer.id)
    if control.flags & v4l2.FLAG_READ_ONLY:
        _fail_with(errno.EACCES)
    if any(control.cid in other.governs.get(other.value, ()) for other in camera.controls.values()):
        _fail_with(errno.EACCES)
    if control.menu and answer.value not in control.menu:
        _fail_with(errno.EINVAL)
    if not control.minimum <= answer.value <= control.maximum:
        _fail_with(errno.ERANGE)
    control.value = answer.value


_ANSWERS: Mapping[int, Callable[[FakeCamera, int, Any], None]] = {
    v4l2.QUERYCAP: _query_capability,
    v4l2.ENUM_FMT: _enumerate_formats,
    v4l2.ENUM_FRAMESIZES: _enumerate_sizes,
    v4l2.ENUM_FRAMEINTERVALS: _enumerate_intervals,
    v4l2.G_FMT: _get_format,
    v4l2.S_FMT: _set_format,
    v4l2.G_PARM: _get_rate,
    v4l2.S_PARM: _set_rate,
    v4l2.REQBUFS: _request_buffers,
    v4l2.QUERYBUF: _query_buffer,
    v4l2.QBUF: _queue_buffer,
    v4l2.DQBUF: _dequeue_buffer,
    v4l2.STREAMON: _stream_on,
    v4l2.STREAMOFF: _stream_off,
    v4l2.QUERY_EXT_CTRL: _query_control,
    v4l2.QUERYCTRL: _query_control,
    v4l2.QUERYMENU: _query_menu,
    v4l2.G_CTRL: _get_control,
    v4l2.S_CTRL: _set_control,
}
