"""Calibrating by hand and by eye: sessions, estimators against the servo plant, and the file that is written."""

import math
import os
import pty
import select
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_calibration import backed_up_file
from vergence_calibration.eye_turn import Image, NoMotionSeenError, azimuth_difference, eye_turn
from vergence_calibration.lost_motion import staircase
from vergence_calibration.servos import servo_file
from vergence_calibration.servos.axis_response import axis_response, calibrated
from vergence_calibration.servos.jog_session import JogSession
from vergence_calibration.servos.visual import VisualParameters, calibrate_head
from vergence_rig.camera import CameraModel
from vergence_rig.rig import CameraSpec
from vergence_rig.servo import MG995, SG90, ServoPlant, ServoSpec
from vergence_servo.calibration import ServoCalibration, ServoCalibrationError, default_servos, load_servos

DEG = math.pi / 180
CAMERA = CameraModel(CameraSpec())


# ---- by hand


def session(old: ServoCalibration | None = None) -> JogSession:
    return JogSession(old or ServoCalibration(channel=4), send=round)


def go(jog: JogSession, pulse_us: float) -> None:
    while abs(jog.pulse_us - pulse_us) >= 1:
        step = pulse_us - jog.pulse_us
        jog.jog("page_up" if step >= 50 else "page_down" if step <= -50 else "up" if step > 0 else "down")


def recorded(
    angles: Mapping[float, float], minimum: float = 700, centre: float = 1480, maximum: float = 2200
) -> JogSession:
    jog = session()
    go(jog, minimum)
    jog.mark_minimum()
    go(jog, centre)
    jog.mark_centre()
    go(jog, maximum)
    jog.mark_maximum()
    for degrees, pulse_us in angles.items():
        go(jog, pulse_us)
        jog.mark_angle(str(degrees))
    return jog


def test_a_recorded_servo_gives_back_its_marks():
    found = recorded({-45: 980, 30: 1820}).result()
    assert found.sign == 1
    assert found.pulse_us(0.0) == pytest.approx(1480)
    assert found.pulse_us(-45 * DEG) == pytest.approx(980)
    assert found.pulse_us(30 * DEG) == pytest.approx(1820)
    assert (found.minimum_us, found.maximum_us) == (700, 2200)
    assert found.lower_rad == pytest.approx(found.joint_rad(700))


def test_a_servo_mounted_the_other_way_gets_the_other_sign():
    found = recorded({-45: 1980, 45: 980}).result()
    assert found.sign == -1
    assert found.pulse_us(-45 * DEG) == pytest.approx(1980)
    assert found.joint_rad(980) == pytest.approx(45 * DEG)


@pytest.mark.parametrize(
    ("jog", "text"),
    [
        (lambda: session(), "minimum, centre, maximum, two angles"),
        (lambda: recorded({-45: 980}), "two angles"),
        (lambda: recorded({-45: 980, 45: 1980}, minimum=1450, maximum=1520), "apart"),
        (lambda: recorded({-45: 980, 45: 1980}, centre=2300), "between"),
        (lambda: recorded({-2: 1450, 2: 1510}), "at least 10 degrees"),
        (lambda: recorded({-45: 1980, 45: 2000}), "must increase or decrease"),
        (lambda: recorded({-45: 980, 45: 1980, 0: 1550}), "angle 0 must be at the centre"),
        (lambda: recorded({-45: 1470, 45: 1490}), "us per rad"),
    ],
)
def test_nonsense_is_rejected(jog, text: str):
    with pytest.raises(ServoCalibrationError, match=text):
        jog().result()


@pytest.mark.parametrize("typed", ["", "left", "nan", "181", "-inf"])
def test_angles_that_are_none_are_rejected(typed: str):
    with pytest.raises(ServoCalibrationError):
        session().mark_angle(typed)


def test_jogging_never_leaves_what_servos_bear():
    jog = session()
    for _ in range(60):
        jog.jog("page_up")
    assert jog.pulse_us == 2500
    for _ in range(60):
        jog.jog("page_down")
    assert jog.pulse_us == 500
    jog.jog("x")
    assert jog.pulse_us == 500


def test_what_is_written_can_be_read_and_the_old_file_is_kept(tmp_path: Path):
    path = tmp_path / "servos.yaml"
    servos = default_servos() | {"tilt": recorded({-45: 1980, 45: 980}).result()}
    text = servo_file.as_text(servos)
    assert backed_up_file.replace(path, text) is None
    read = load_servos(path)
    assert read["pan_left"] == servos["pan_left"]
    assert read["tilt"].pulse_us(0.3) == pytest.approx(servos["tilt"].pulse_us(0.3), abs=1e-3)
    assert "+    channel: 9" in backed_up_file.difference(path, text.replace("channel: 4", "channel: 9")).replace(
        ", ", "\n"
    )
    kept = [backed_up_file.replace(path, text), backed_up_file.replace(path, text)]
    assert len(set(kept)) == 2
    assert all(old is not None and old.read_text() == text for old in kept)
    assert sorted(p.suffix for p in tmp_path.iterdir()) == [".bak", ".bak", ".yaml"]


class Terminal:
    """calibrate_servos on a pseudo-terminal."""

    def __init__(self, *arguments: str) -> None:
        self._master, slave = pty.openpty()
        argv = [sys.executable, "-m", "vergence_calibration.ros.calibrate_servos", *arguments]
        self.process = subprocess.Popen(argv, stdin=slave, stdout=slave, stderr=slave, start_new_session=True)
        os.close(slave)
        self.shown = ""

    def expect(self, text: str) -> None:
        deadline_s = time.monotonic() + 90
        while text not in self.shown:
            assert select.select([self._master], [], [], max(0.0, deadline_s - time.monotonic()))[0], self.shown
            self.shown += os.read(self._master, 65536).decode(errors="replace")
        self.shown = self.shown.split(text, 1)[1]

    def press(self, keys: str) -> None:
        os.write(self._master, keys.encode())

    def close(self) -> None:
        self.process.wait(90)
        os.close(self._master)


def test_the_whole_dialogue_on_a_terminal(tmp_path: Path):
    path = tmp_path / "servos.yaml"
    path.write_text("servos:\n  tilt: {channel: 2, model: mg995, backend: fake}\n  pan_left: {channel: 0}\n")
    terminal = Terminal("--servos", str(path), "--backend", "fake")
    terminal.expect("tilt, fake channel 2, mg995")
    terminal.expect("c calibrates")
    terminal.press("c")
    terminal.expect("1500.0 us")
    terminal.press("\n")
    terminal.expect("not recorded yet")
    terminal.press("\x1b[5~" * 6)
    terminal.expect("1800.0 us")
    terminal.press("]a")
    terminal.expect("in degrees")
    terminal.press("30\n")
    terminal.expect("+30.0 at 1800")
    terminal.press("\x1b[6~" * 12)
    terminal.expect("1200.0 us")
    terminal.press("[a")
    terminal.expect("in degrees")
    terminal.press("-30\n")
    terminal.expect("-30.0 at 1200")
    terminal.press("\x1b[5~" * 6 + "\x1b[A" + "\x1b[D")
    terminal.expect("1491.0 us")
    terminal.press("0")
    terminal.expect("centre   0       1491.0 us")
    terminal.press("\n")
    terminal.expect("pan_left, fake channel 0")
    terminal.press("\n")
    terminal.expect("write ")
    terminal.press("y\n")
    terminal.expect("wrote")
    terminal.close()
    assert terminal.process.returncode == 0
    found = load_servos(path)
    assert found["tilt"].pulse_us(0.0) == pytest.approx(1491)
    assert (found["tilt"].backend, found["pan_left"].backend) == ("fake", "")
    assert found["pan_left"].channel == 0
    assert len(list(tmp_path.glob("servos.yaml.*.bak"))) == 1


def test_a_servo_with_a_backend_of_its_own_needs_no_other(tmp_path: Path):
    path = tmp_path / "servos.yaml"
    path.write_text("servos:\n  tilt: {channel: 2, backend: fake}\n  pan_left: {channel: 0}\n")
    # kernel_pwm, the default, is not opened: there is no such chip here.
    terminal = Terminal("--servos", str(path), "--joint", "tilt", "--set", "fake.resolution_us=5")
    terminal.expect("tilt, fake channel 2")
    terminal.press("\n")
    terminal.expect("nothing to change")
    terminal.close()
    assert terminal.process.returncode == 0


def test_saying_no_leaves_the_file(tmp_path: Path):
    path = tmp_path / "servos.yaml"
    terminal = Terminal("--servos", str(path), "--backend", "fake", "--joint", "tilt")
    terminal.expect("c calibrates")
    terminal.press("\n")
    terminal.expect("write ")
    terminal.press("n\n")
    terminal.expect("nothing was written")
    terminal.close()
    assert terminal.process.returncode == 1
    assert not path.exists()


# ---- by eye: the response of one axis


def played(servo: ServoCalibration, plant: ServoSpec, sign: int, gain: float, amplitude_deg: float, noise_rad: float):
    """Return pulses and angles as a servo of another mounting and gain gives them for the staircase."""
    random = np.random.default_rng(3)
    shaft = ServoPlant(plant, 0.0)
    pulses, angles, now_s = [], [], 0.0
    for commanded_rad in staircase(amplitude_deg * DEG, 10, 2):
        pulse_us = servo.pulse_us(commanded_rad)
        shaft.command(sign * gain * (pulse_us - 1500.0), now_s)
        now_s += 1.0
        pulses.append(pulse_us)
        angles.append(shaft.step(now_s) + random.normal(0, noise_rad))
    return pulses, angles


@settings(deadline=None, max_examples=50)
@given(
    sign=st.sampled_from([1, -1]),
    gain=st.floats(0.06, 0.13),
    plant=st.sampled_from([SG90, MG995]),
    amplitude_deg=st.floats(5.0, 10.0),
)
def test_sign_gain_and_lost_motion_of_a_servo_are_found(sign: int, gain: float, plant: ServoSpec, amplitude_deg: float):
    pulses, angles = played(ServoCalibration(channel=0), plant, sign, gain * DEG, amplitude_deg, 0.02 * DEG)
    found = axis_response(pulses, angles)
    assert found.sign == sign
    assert found.gain_rad_per_us == pytest.approx(gain * DEG, rel=0.03)
    lost_rad = plant.dead_band_rad + plant.backlash_rad
    assert found.lost_motion_rad == pytest.approx(lost_rad, abs=0.15 * DEG)
    better = calibrated(ServoCalibration(channel=0), found)
    assert better.sign * better.pulse_us(20 * DEG) > better.sign * 1500
    assert abs(better.joint_rad(1600.0)) == pytest.approx(100 * gain * DEG, rel=0.03)
    assert better.dead_band_rad + better.backlash_rad == pytest.approx(found.lost_motion_rad)


def test_an_offset_moves_the_centre_the_right_way():
    pulses, angles = played(ServoCalibration(channel=0), SG90, -1, 0.1 * DEG, 6.0, 0.0)
    found = axis_response(pulses, angles)
    better = calibrated(ServoCalibration(channel=0), found, offset_rad=2.0 * DEG)
    # commanded 0 (1500 us) the joint stood at +2 degrees; with sign -1 it takes longer pulses to come back
    assert better.pulse_us(0.0) == pytest.approx(1520.0, abs=1.0)


@pytest.mark.parametrize(
    ("pulses", "angles", "text"),
    [
        ([1500.0] * 20, [0.0] * 20, "too small"),
        (list(range(1400, 1600, 10)), [0.0] * 20, "too small"),
        ([1400, 1500, 1600], [0.0, 0.1, 0.2], "8 or more"),
    ],
)
def test_moves_that_tell_nothing_are_refused(pulses: list[float], angles: list[float], text: str):
    with pytest.raises(ServoCalibrationError, match=text):
        axis_response(pulses, angles)


def test_a_servo_that_does_not_move_is_refused():
    pulses = [ServoCalibration(channel=0).pulse_us(angle) for angle in staircase(0.1, 10, 2)]
    with pytest.raises(ServoCalibrationError, match=r"0\.02 to 0\.35"):
        axis_response(pulses, [0.0] * len(pulses))


# ---- by eye: what the cameras see


def wall(seed: int = 0) -> Image:
    """A texture that fills more than any view."""
    random = np.random.default_rng(seed)
    picture = np.full((1400, 1600), 120, np.uint8)
    for _ in range(1500):
        x, y, w, h = (int(v) for v in (*random.integers(0, 1600, 2), *random.integers(6, 60, 2)))
        cv2.rectangle(picture, (x, y), (x + w, y + h), int(random.integers(20, 235)), -1)
    return cv2.GaussianBlur(picture, (0, 0), 1.0)


def seen(pan_rad: float, tilt_rad: float, picture: Image) -> Image:
    """The view of a far wall: pixel = K R^-1 K^-1 of the wall, whose middle lies straight ahead."""
    k = np.array([[539.0, 0, 319.5], [0, 539.0, 239.5], [0, 0, 1]])
    wide = np.array([[539.0, 0, 799.5], [0, 539.0, 699.5], [0, 0, 1]])
    # optical frame x right, y down, z ahead: pan left turns about -y, tilt down about -x
    pan = cv2.Rodrigues(np.array([0.0, -pan_rad, 0.0]))[0]
    tilt = cv2.Rodrigues(np.array([-tilt_rad, 0.0, 0.0]))[0]
    return cv2.warpPerspective(picture, k @ (tilt @ pan).T @ np.linalg.inv(wide), (640, 480))


@pytest.mark.parametrize(("pan", "tilt"), [(5.0, 0.0), (-7.0, 0.0), (0.0, 6.0), (0.0, -4.0), (0.3, 0.0), (0.0, 0.0)])
def test_an_eyes_turn_is_seen_with_its_sign(pan: float, tilt: float):
    picture = wall()
    turn = eye_turn(seen(0.0, 0.0, picture), seen(pan * DEG, tilt * DEG, picture), CAMERA)
    assert turn.pan_rad / DEG == pytest.approx(pan, abs=0.03)
    assert turn.tilt_rad / DEG == pytest.approx(tilt, abs=0.03)


def test_a_blank_wall_is_refused():
    blank = np.full((480, 640), 90, np.uint8)
    with pytest.raises(NoMotionSeenError):
        eye_turn(blank, blank, CAMERA)
    with pytest.raises(NoMotionSeenError):
        azimuth_difference(blank, blank, CAMERA, CAMERA)


class WallHead:
    """A head before a far wall, with servos of its own that are not as the file says."""

    def __init__(self, servos: Mapping[str, ServoCalibration], signs: Mapping[str, int], zeros: Mapping[str, float]):
        self.picture, self.now_s, self.servos, self.signs, self.zeros = wall(1), 0.0, servos, signs, zeros
        self.plants = {name: ServoPlant(SG90, zeros.get(name, 0.0)) for name in servos}

    def look(self, joints_rad: Mapping[str, float]) -> dict[str, Image]:
        true = {}
        for name, plant in self.plants.items():
            pulse_us = self.servos[name].pulse_us(joints_rad[name])
            gain = 0.1 * DEG * self.signs.get(name, 1)
            plant.command(gain * (pulse_us - 1500.0) + self.zeros.get(name, 0.0), self.now_s)
            true[name] = plant.step(self.now_s + 1.0)
        self.now_s += 1.0
        return {eye: seen(true[f"pan_{eye}"], true["tilt"], self.picture) for eye in ("left", "right")}


def test_the_whole_head_is_calibrated_by_what_it_sees():
    old = default_servos()
    head = WallHead(old, signs={"pan_right": -1, "tilt": -1}, zeros={"pan_left": 1.5 * DEG, "pan_right": -1.5 * DEG})
    commanded: list[str] = []
    cameras = {"left": CAMERA, "right": CAMERA}
    fresh = calibrate_head(head, old, cameras, 1e-6, VisualParameters(far_m=1e3), commanded.append)
    assert [fresh[name].sign for name in fresh] == [1, -1, -1]
    for name in fresh:
        assert abs(fresh[name].joint_rad(1600) - fresh[name].joint_rad(1500)) == pytest.approx(10 * DEG, rel=0.05)
        lost_rad = fresh[name].dead_band_rad + fresh[name].backlash_rad
        assert lost_rad == pytest.approx(SG90.dead_band_rad + SG90.backlash_rad, abs=0.25 * DEG)
    # commanded 0, the eyes diverged by 3 degrees: each gets half of it back
    assert fresh["pan_left"].joint_rad(1500) == pytest.approx(1.5 * DEG, abs=0.7 * DEG)
    assert fresh["pan_right"].joint_rad(1500) == pytest.approx(-1.5 * DEG, abs=0.7 * DEG)
    assert len(commanded) > 60
