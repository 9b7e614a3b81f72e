"""Streaming from a fake kernel: bytes, stamps, modes and every errno that a webcam has given."""

import errno
import time
from collections.abc import Callable
from ctypes import Structure

import numpy as np
import pytest

from vergence_camera.errors import (
    CameraError,
    CameraNotFoundError,
    CorruptFrameError,
    DeviceBusyError,
    ModeMismatchError,
    PermissionDeniedError,
    UnpluggedError,
    UnsupportedError,
    UsbBandwidthError,
    WrongSizeError,
)
from vergence_camera.frame import Clock, Encoding, ModeRequest
from vergence_camera.pixels import decode
from vergence_camera.testing.fake_camera import FakeCamera
from vergence_camera.testing.fake_kernel import FakeKernel
from vergence_camera.v4l2 import structures as v4l2
from vergence_camera.v4l2.capture import V4l2Source
from vergence_camera.v4l2.formats import offered_sizes

Make = Callable[..., bytes]
PATH = "/dev/video0"


@pytest.fixture
def camera() -> FakeCamera:
    return FakeCamera()


@pytest.fixture
def kernel(camera: FakeCamera) -> FakeKernel:
    return FakeKernel({PATH: camera})


def source_of(kernel: FakeKernel, *request: object, buffers: int = 4) -> V4l2Source:
    wanted = ModeRequest(*(request or ("MJPG", 640, 480, 30.0)))  # type: ignore[arg-type]
    return V4l2Source(kernel, lambda: PATH, "camera", wanted, buffers=buffers)


def test_the_cameras_own_bytes_and_the_kernels_own_stamp(
    kernel: FakeKernel, camera: FakeCamera, make_jpeg: Make
) -> None:
    source = source_of(kernel)
    assert str(source.open()) == "MJPG 640x480 at 30 Hz"
    stamp_ns = time.monotonic_ns() - 5_000_000
    padded = make_jpeg(3) + bytes(100)
    camera.push(padded, stamp_ns)
    frame = source.read(0.1)
    assert frame is not None
    assert frame.data == padded
    assert (frame.encoding, frame.width_px, frame.height_px) == (Encoding.JPEG, 640, 480)
    assert (frame.clock, frame.time_ns) == (Clock.MONOTONIC, stamp_ns // 1000 * 1000)
    assert (frame.sequence, frame.skipped) == (0, 0)


def test_silence(kernel: FakeKernel) -> None:
    source = source_of(kernel)
    source.open()
    assert source.read(0.01) is None


def test_only_the_newest_of_waiting_frames_and_the_buffers_go_round(
    kernel: FakeKernel, camera: FakeCamera, make_jpeg: Make
) -> None:
    source = source_of(kernel)
    source.open()
    for round_ in range(5):
        for number in range(3):
            assert camera.push(make_jpeg(3 * round_ + number))
        frame = source.read(0.1)
        assert frame is not None
        assert frame.data == make_jpeg(3 * round_ + 2)
        assert (frame.sequence, frame.skipped) == (3 * round_ + 2, 2)
        assert len(camera.queued) == 4


def test_frames_lost_in_the_driver_show_in_the_sequence(
    kernel: FakeKernel, camera: FakeCamera, make_jpeg: Make
) -> None:
    source = source_of(kernel, buffers=2)
    source.open()
    assert [camera.push(make_jpeg(n)) for n in range(4)] == [True, True, False, False]
    assert source.read(0.1).sequence == 1  # type: ignore[union-attr]
    camera.push(make_jpeg(4))
    assert source.read(0.1).sequence == 4  # type: ignore[union-attr]


def test_wall_clock_stamps_are_recognised(kernel: FakeKernel, camera: FakeCamera, make_jpeg: Make) -> None:
    camera.timestamp_flags = 0
    source = source_of(kernel)
    source.open()
    stamp_ns = time.time_ns() - 20_000_000
    camera.push(make_jpeg(), stamp_ns)
    frame = source.read(0.1)
    assert frame is not None
    assert (frame.clock, frame.time_ns) == (Clock.WALL, stamp_ns // 1000 * 1000)


def test_monotonic_stamps_without_the_flag_are_recognised(
    kernel: FakeKernel, camera: FakeCamera, make_jpeg: Make
) -> None:
    camera.timestamp_flags = 0
    source = source_of(kernel)
    source.open()
    camera.push(make_jpeg(), time.monotonic_ns() - 20_000_000)
    assert source.read(0.1).clock is Clock.MONOTONIC  # type: ignore[union-attr]


def test_a_stamp_that_fits_no_clock_becomes_the_time_of_the_grab(
    kernel: FakeKernel, camera: FakeCamera, make_jpeg: Make
) -> None:
    camera.timestamp_flags = 0
    source = source_of(kernel)
    source.open()
    before = time.monotonic_ns()
    camera.push(make_jpeg(), 1000)
    frame = source.read(0.1)
    assert frame is not None
    # A machine that booted seconds ago could take 1 us for a stamp of its own.
    assert frame.clock is Clock.MONOTONIC
    assert frame.time_ns >= before or time.monotonic_ns() < 11e9


@pytest.mark.parametrize(
    ("request_", "actual"),
    [(("MJPG", 1280, 720, 30.0), "MJPG 1280x720 at 30 Hz"), (("MJPG", 640, 480, 14.0), "MJPG 640x480 at 15 Hz")],
)
def test_mode_asked_and_given(kernel: FakeKernel, request_: tuple[object, ...], actual: str) -> None:
    assert str(source_of(kernel, *request_).open()) == actual


@pytest.mark.parametrize("request_", [("MJPG", 1024, 768, 30.0), ("GREY", 640, 480, 30.0), ("YUYV", 320, 240, 30.0)])
def test_a_hard_mismatch_names_both_and_what_is_offered(kernel: FakeKernel, request_: tuple[object, ...]) -> None:
    with pytest.raises(ModeMismatchError) as caught:
        source_of(kernel, *request_).open()
    message = str(caught.value)
    assert f"{request_[0]} {request_[1]}x{request_[2]}" in message
    assert "the camera gives" in message
    assert "MJPG 1280x720 at 30 Hz" in message
    assert kernel.open_descriptors == []


def test_a_size_of_zero_takes_what_there_is(kernel: FakeKernel) -> None:
    assert str(source_of(kernel, "", 0, 0, 0.0).open()) == "MJPG 640x480 at 30 Hz"


def test_yuyv_is_decoded(kernel: FakeKernel, camera: FakeCamera) -> None:
    source = source_of(kernel, "YUYV", 640, 480, 30.0)
    source.open()
    grey = np.full((480, 640, 2), 128, np.uint8)
    grey[:, :, 0] = np.linspace(16, 235, 640).astype(np.uint8)
    camera.push(grey.tobytes())
    frame = source.read(0.1)
    assert frame is not None
    pixels, encoding = decode(frame)
    assert (pixels.shape, encoding) == ((480, 640, 3), "bgr8")
    assert pixels[0, 0].max() <= 3
    assert pixels[0, -1].min() >= 250


def test_padded_rows_are_cut(make_pixels: Callable[..., np.ndarray]) -> None:
    camera = FakeCamera(sizes={"GREY": {(60, 40): (30,)}})
    kernel = FakeKernel({PATH: camera})
    source = source_of(kernel, "GREY", 60, 40, 30.0)
    source.open()
    source._row_bytes = 64  # the driver's answer to S_FMT; the fake pads nothing
    picture = make_pixels(0, 64, 40)[:, :, 0]
    camera.push(np.ascontiguousarray(picture).tobytes())
    frame = source.read(0.1)
    assert frame is not None
    assert np.array_equal(decode(frame)[0], picture[:, :60])


def test_a_short_raw_frame_is_dropped(kernel: FakeKernel, camera: FakeCamera) -> None:
    source = source_of(kernel, "YUYV", 640, 480, 30.0)
    source.open()
    camera.push(bytes(1000))
    with pytest.raises(CorruptFrameError, match="got 1000"):
        source.read(0.1)


def test_damaged_frames_are_dropped_and_the_stream_goes_on(
    kernel: FakeKernel, camera: FakeCamera, make_jpeg: Make
) -> None:
    source = source_of(kernel)
    source.open()
    for data, damaged, error in (
        (make_jpeg(), True, CorruptFrameError),
        (make_jpeg()[:3000], False, CorruptFrameError),
        (b"", False, CorruptFrameError),
        (make_jpeg(0, 320, 240), False, WrongSizeError),
    ):
        camera.push(data, damaged=damaged)
        with pytest.raises(error):
            source.read(0.1)
    camera.push(make_jpeg(9))
    assert source.read(0.1).data == make_jpeg(9)  # type: ignore[union-attr]
    assert len(camera.queued) == 4


@pytest.mark.parametrize(
    ("number", "error", "text"),
    [
        (errno.ENOENT, CameraNotFoundError, "not plugged in"),
        (errno.EACCES, PermissionDeniedError, "usermod -aG"),
        (errno.EBUSY, DeviceBusyError, "uses it"),
        (errno.ENODEV, UnpluggedError, "unplugged"),
        (errno.EIO, UnpluggedError, "unplugged"),
    ],
)
def test_opening_failures(
    kernel: FakeKernel, camera: FakeCamera, number: int, error: type[CameraError], text: str
) -> None:
    camera.open_errno = number
    with pytest.raises(error, match=text):
        source_of(kernel).open()


def test_no_bandwidth_says_usb_and_what_to_change(kernel: FakeKernel, camera: FakeCamera) -> None:
    camera.stream_errno = errno.ENOSPC
    with pytest.raises(UsbBandwidthError, match=r"No space left on device.*USB bandwidth, not the disk.*controller"):
        source_of(kernel).open()
    assert kernel.open_descriptors == []


def test_a_second_reader_is_told_that_it_is_busy(kernel: FakeKernel) -> None:
    first, second = source_of(kernel), source_of(kernel)
    first.open()
    with pytest.raises(DeviceBusyError):
        second.open()
    first.close()
    second.open()


def test_unplugged_while_it_streams(kernel: FakeKernel, camera: FakeCamera, make_jpeg: Make) -> None:
    source = source_of(kernel)
    source.open()
    camera.unplug()
    with pytest.raises(UnpluggedError):
        source.read(0.1)
    source.close()
    assert kernel.open_descriptors == []
    camera.plug_in()
    source.open()
    camera.push(make_jpeg())
    assert source.read(0.1) is not None


def test_a_device_without_pictures(kernel: FakeKernel, camera: FakeCamera) -> None:
    camera.capabilities = 0x00A0_0000
    with pytest.raises(UnsupportedError, match="is no capture device"):
        source_of(kernel).open()


def test_reading_before_opening(kernel: FakeKernel) -> None:
    with pytest.raises(CameraError, match="before open"):
        source_of(kernel).read(0.1)


def test_what_is_offered(kernel: FakeKernel) -> None:
    offered = [str(size) for size in offered_sizes(kernel, kernel.open(PATH))]
    assert offered == [
        "MJPG 640x480 at 30/15 Hz",
        "MJPG 1280x720 at 30 Hz",
        "MJPG 320x240 at 30 Hz",
        "YUYV 640x480 at 30 Hz",
        "YUYV 1280x720 at 10 Hz",
    ]


def test_a_driver_without_rates(kernel: FakeKernel, monkeypatch: pytest.MonkeyPatch) -> None:
    answer = kernel.ioctl

    def without_rates(descriptor: int, request: int, argument: Structure) -> None:
        if request in (v4l2.G_PARM, v4l2.S_PARM):
            raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
        answer(descriptor, request, argument)

    monkeypatch.setattr(kernel, "ioctl", without_rates)
    assert str(source_of(kernel).open()) == "MJPG 640x480 at unknown rate"
