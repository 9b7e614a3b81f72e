"""Cameras and servos as a body: pictures of two sources, commands to fake servos, and clean ends."""

import threading
from collections.abc import Iterator
from pathlib import Path

import cv2
import pytest

from vergence import BodyError, Head
from vergence.camera_body import CameraBody, ServoThread
from vergence.testing.wall_body import WallBody
from vergence_camera.errors import CameraError
from vergence_camera.source_choice import SourceOptions, make_source
from vergence_metric.pairs.pairing import LEFT, RIGHT
from vergence_rig.rig import default_rig
from vergence_servo.drivers.fake import FakeDriver
from vergence_servo.parameters import ServoNodeParameters
from vergence_servo.servo_channel import RetryParameters
from vergence_servo.servo_hardware import ServoHardware

ENDS_S = 30.0


@pytest.fixture
def folders(tmp_path: Path) -> tuple[str, str]:
    """Two folders of pictures, what the eyes of a wall body see."""
    wall = WallBody()
    for name, side in (("left", LEFT), ("right", RIGHT)):
        (tmp_path / name).mkdir()
        for number in range(5):
            cv2.imwrite(str(tmp_path / name / f"{number}.png"), wall.view(side))
    return str(tmp_path / "left"), str(tmp_path / "right")


@pytest.fixture
def servos(tmp_path: Path) -> Iterator[ServoHardware]:
    values = ServoNodeParameters(pose_file=str(tmp_path / "pose.json"), park_time_limit_s=0.2)
    hardware = ServoHardware(values, RetryParameters())
    yield hardware
    hardware.close()


def driver_of(hardware: ServoHardware) -> FakeDriver:
    driver = hardware.drivers.by_joint["pan_left"]
    assert isinstance(driver, FakeDriver)
    return driver


def test_files_are_measured_and_eyes_without_servos_stay(folders: tuple[str, str]) -> None:
    with Head.cameras(*folders, width_px=0, height_px=0, rate_hz=0.0, loop=True) as head:
        found = head.measure()
        with pytest.raises(BodyError, match="this head has none"):
            head.look_at(pixel=(330, 240))
    assert found.disparity.horizontal_px == pytest.approx(12.0, abs=0.5)


def test_a_recording_that_has_ended_says_so(folders: tuple[str, str]) -> None:
    with (
        Head.cameras(*folders, width_px=0, height_px=0, rate_hz=0.0) as head,
        pytest.raises(BodyError, match="has ended"),
    ):
        head.run(ENDS_S)


def test_a_look_turns_the_servos_and_closing_releases_them(folders: tuple[str, str], servos: ServoHardware) -> None:
    options = SourceOptions(replay_loop=True)
    body = CameraBody(make_source(folders[0], options), make_source(folders[1], options), default_rig(), servos)
    driver, channel = driver_of(servos), servos.head.channels["pan_left"].limits.calibration.channel
    with Head(body) as head:
        head.look_at(angles_rad=(0.2, 0.02, 0.0)).wait()
        assert driver.pulse_us(channel) is not None
        assert head.report is not None
        assert head.report.version_rad == pytest.approx(0.2, abs=0.03)
    assert driver.closed
    assert driver.pulse_us(channel) is None
    assert not any(thread.name == "servos" and thread.is_alive() for thread in threading.enumerate())


def test_a_camera_that_is_not_there_releases_the_servos(folders: tuple[str, str], servos: ServoHardware) -> None:
    options = SourceOptions()
    with pytest.raises(CameraError):
        CameraBody(make_source(folders[0], options), make_source("/dev/video99", options), default_rig(), servos)
    assert driver_of(servos).closed


def test_a_refused_command_and_a_failed_thread_are_errors(servos: ServoHardware) -> None:
    thread = ServoThread(servos)
    with pytest.raises(BodyError, match="joint must be one of"):
        thread.command({"neck": 0.1})
    thread.close()
    failing = ServoThread(servos, period_s=0.001)
    servos.head.step = _fail  # type: ignore[method-assign]
    failing._thread.join(ENDS_S)
    with pytest.raises(BodyError, match="cannot be driven: no bus"):
        failing.positions_rad()
    del servos.head.step
    failing.close()


def _fail(now_s: float) -> None:
    raise OSError("no bus")
