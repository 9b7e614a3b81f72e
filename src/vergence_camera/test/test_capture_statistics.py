"""The counts that diagnostics show."""

import math

import pytest

from vergence_camera.capture_statistics import CaptureStatistics
from vergence_camera.errors import UsbBandwidthError, WrongSizeError
from vergence_camera.frame import Mode


class Steady:
    """A clock set by hand."""

    def __init__(self) -> None:
        self.s = 100.0

    def __call__(self) -> float:
        return self.s


def test_rate_age_and_delay() -> None:
    clock = Steady()
    health = CaptureStatistics(clock)
    health.connected(Mode("MJPG", 640, 480, 30.0))
    for number in range(31):
        health.received(number, 0)
        health.published(0.002 if number % 3 else 0.1)
        clock.s += 0.04
    state = health.snapshot()
    assert state.rate_hz == pytest.approx(25.0)
    assert state.age_s == pytest.approx(0.04)
    assert state.stamp_to_publish_s == pytest.approx(0.002)
    assert state.frames == 31


def test_nothing_measured_yet_is_nan() -> None:
    state = CaptureStatistics().snapshot()
    assert math.isnan(state.rate_hz)
    assert math.isnan(state.age_s)
    assert not state.connected


def test_where_frames_were_lost() -> None:
    health = CaptureStatistics()
    health.connected(Mode("MJPG", 640, 480, 30.0))
    health.received(10, 0)  # the first number says nothing
    health.received(13, 1)  # 11 lost before us, 12 dropped for 13
    health.corrupt(WrongSizeError("small"))  # 14
    health.received(15, 0)
    state = health.snapshot()
    assert (state.dropped_by_driver, state.skipped, state.corrupt) == (1, 1, 1)
    assert state.faults == {"wrong_size": 1}


def test_a_reconnect_begins_the_sequence_anew() -> None:
    health = CaptureStatistics()
    mode = Mode("MJPG", 640, 480, 30.0)
    health.connected(mode)
    health.received(500, 0)
    health.fault(UsbBandwidthError("full"))
    assert not health.snapshot().connected
    health.connected(mode)
    health.received(700, 0)
    state = health.snapshot()
    assert (state.dropped_by_driver, state.reconnects) == (0, 1)
    assert state.values()["fault.usb_bandwidth"] == 1
    assert state.values()["last_fault"] == "full"


def test_the_time_without_a_published_frame_counts_from_the_start_and_from_the_last_one() -> None:
    clock = Steady()
    health = CaptureStatistics(clock)
    health.connected(Mode("MJPG", 640, 480, 30.0))
    clock.s += 2.0
    health.received(1, 0)
    health.too_old()
    assert health.snapshot().unpublished_s == pytest.approx(2.0)
    health.published(0.01)
    clock.s += 0.5
    assert health.snapshot().unpublished_s == pytest.approx(0.5)
