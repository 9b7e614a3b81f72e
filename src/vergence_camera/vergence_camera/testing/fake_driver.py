"""A webcam driver's replies to each ioctl.

It keeps the driver's side of the contract: a format that is not offered becomes the nearest one, one process streams
at a time, a frame without a queued buffer is lost but counted, an automatic control makes its manual one inactive.
"""

import errno
import os
from collections.abc import Callable, Mapping
from typing import Any

from vergence_camera.testing.fake_camera import FakeCamera
from vergence_camera.testing.fake_controls import FakeControl
from vergence_camera.v4l2 import structures as v4l2


def fail_with(number: int) -> None:
    """Raise OSError with this errno; do nothing for 0."""
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
        fail_with(errno.EINVAL)
    return values[index]


def _get_format(camera: FakeCamera, _: int, answer: Any) -> None:
    pixels = answer.fmt.pix
    pixels.width, pixels.height, pixels.pixelformat = camera.width, camera.height, v4l2.fourcc(camera.code)
    pixels.bytesperline = 0 if camera.code == "MJPG" else camera.width * (1 if camera.code == "GREY" else 2)
    pixels.sizeimage = camera.width * camera.height * 2


def _set_format(camera: FakeCamera, descriptor: int, answer: Any) -> None:
    if camera.streamer not in (0, descriptor):
        fail_with(errno.EBUSY)
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
        fail_with(errno.EBUSY)
    camera.memory = [bytearray(camera.width * camera.height * 2) for _ in range(answer.count)]
    camera.queued.clear()
    camera.filled.clear()


def _query_buffer(camera: FakeCamera, _: int, answer: Any) -> None:
    answer.length, answer.m.offset = len(camera.memory[answer.index]), answer.index << 12


def _queue_buffer(camera: FakeCamera, _: int, answer: Any) -> None:
    camera.queued.append(answer.index)


def _dequeue_buffer(camera: FakeCamera, _: int, answer: Any) -> None:
    fail_with(camera.dequeue_errno)
    if not camera.filled:
        fail_with(errno.EAGAIN)
    buffer = camera.filled.popleft()
    for name in ("index", "bytesused", "flags", "timestamp", "sequence"):
        setattr(answer, name, getattr(buffer, name))


def _stream_on(camera: FakeCamera, descriptor: int, _: Any) -> None:
    fail_with(camera.stream_errno)
    camera.streamer = descriptor


def _stream_off(camera: FakeCamera, _: int, __: Any) -> None:
    camera.streamer = 0
    camera.queued.clear()
    camera.filled.clear()


def _next_control(camera: FakeCamera, cid: int) -> FakeControl:
    if cid & v4l2.FLAG_NEXT_CTRL:
        cid = min((known for known in camera.controls if known > cid & ~v4l2.FLAG_NEXT_CTRL), default=0)
    if cid not in camera.controls:
        fail_with(errno.EINVAL)
    return camera.controls[cid]


def _query_control(camera: FakeCamera, _: int, answer: Any) -> None:
    if isinstance(answer, v4l2.QueryExtControl) and not camera.extended_query:
        fail_with(errno.ENOTTY)
    control = _next_control(camera, answer.id)
    inactive = any(control.cid in other.governs.get(other.value, ()) for other in camera.controls.values())
    answer.id, answer.type, answer.name = control.cid, control.kind, control.name.encode()
    answer.minimum, answer.maximum, answer.step = control.minimum, control.maximum, control.step
    answer.default_value = control.default
    answer.flags = control.flags | (v4l2.FLAG_INACTIVE if inactive else 0)


def _query_menu(camera: FakeCamera, _: int, answer: Any) -> None:
    control = _next_control(camera, answer.id)
    if answer.index not in control.menu:
        fail_with(errno.EINVAL)
    if control.kind == v4l2.CTRL_INTEGER_MENU:
        answer.item.value = int(control.menu[answer.index])
    else:
        answer.item.name = control.menu[answer.index].encode()


def _get_control(camera: FakeCamera, _: int, answer: Any) -> None:
    control = _next_control(camera, answer.id)
    fail_with(control.read_errno)
    answer.value = control.value


def _set_control(camera: FakeCamera, _: int, answer: Any) -> None:
    control = _next_control(camera, answer.id)
    if control.flags & v4l2.FLAG_READ_ONLY:
        fail_with(errno.EACCES)
    if any(control.cid in other.governs.get(other.value, ()) for other in camera.controls.values()):
        fail_with(errno.EACCES)
    if control.menu and answer.value not in control.menu:
        fail_with(errno.EINVAL)
    if not control.minimum <= answer.value <= control.maximum:
        fail_with(errno.ERANGE)
    control.value = answer.value


ANSWERS: Mapping[int, Callable[[FakeCamera, int, Any], None]] = {
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
"""By request: what the driver does with the argument for a descriptor."""
