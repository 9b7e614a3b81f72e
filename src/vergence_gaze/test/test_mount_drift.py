"""Slow offsets of the cameras' mounts: a bump is corrected, play and wrong readings are not taken for one."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.mount_drift import MOST_CORRECTED_RAD, MountDrift, MountReading
from vergence_gaze.estimation.observations import EyeRotationObservation, JointReport
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_rig.rig import default_rig

DEG = math.pi / 180
PLAY_DEG, READING_DEG = 0.3, 0.03


class Eyes:
    """Rests of a head whose right camera stands off by `true_deg`; the play differs from rest to rest."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.drift = MountDrift()
        self.changes = 0

    def rest(self, true_deg: float, roll_deg: float = 0.0, pitch_deg: float = 0.0, wrong: float = 0.0) -> None:
        rig, noise = default_rig(), self.random.normal(0, READING_DEG, 3)
        joints = self.random.uniform(-0.3, 0.3, 3)
        off_deg = true_deg + self.random.uniform(-PLAY_DEG, PLAY_DEG) + noise[0]
        if self.random.random() < wrong:
            off_deg += self.random.uniform(-5, 5)
        measured_rad = joints[1] - joints[0] + off_deg * DEG
        left, right, _ = self.drift.corrected(rig).eye_angles(joints.tolist())
        vergence_rad = float(measured_rad - (right - left))
        self.drift.update(MountReading(vergence_rad, (roll_deg + noise[1]) * DEG, (pitch_deg + noise[2]) * DEG))
        self.changes += self.drift.on_pan_moved()


@settings(deadline=None, max_examples=40, derandomize=True)
@given(seed=st.integers(0, 10_000))
def test_play_alone_asks_for_nothing_and_corrects_next_to_nothing(seed: int) -> None:
    eyes = Eyes(seed)
    for _ in range(60):
        eyes.rest(0.0, wrong=0.1)
        assert abs(eyes.drift.correction_rad) < 0.35 * DEG
        assert eyes.drift.request == ""


@pytest.mark.parametrize("bump_deg", [-1.6, 0.8, 1.5])
def test_a_bump_within_the_limit_is_corrected(bump_deg: float) -> None:
    eyes = Eyes(1)
    for _ in range(20):
        eyes.rest(0.0, wrong=0.1)
    for _ in range(20):
        eyes.rest(bump_deg, wrong=0.1)
    assert eyes.drift.correction_rad == pytest.approx(bump_deg * DEG, abs=0.3 * DEG)
    assert eyes.drift.request == ""
    summary = eyes.drift.summary()
    assert summary["mount_vergence_corrected_deg"] == pytest.approx(bump_deg, abs=0.3)
    rig = default_rig()
    corrected = eyes.drift.corrected(rig)
    left, right, tilt = corrected.eye_angles((0.1, 0.2, 0.05))
    assert right - left == pytest.approx(0.1 + eyes.drift.correction_rad)
    assert 0.5 * (left + right) == pytest.approx(0.15)
    assert tilt == 0.05


@pytest.mark.parametrize(
    ("off", "text"),
    [
        ({"true_deg": 3.0}, r"vergence must be within 2.0 degrees of rig.yaml's: got \+[23]"),
        ({"true_deg": 0.0, "roll_deg": -1.4}, r"roll between the eyes must be within 1.0 degrees .* got -1\.[34]"),
        ({"true_deg": 0.0, "pitch_deg": 2.0}, r"pitch between the eyes must be within 1.0 degrees .* got \+[12]"),
    ],
)
def test_a_larger_change_asks_for_identify(off: dict[str, float], text: str) -> None:
    eyes = Eyes(2)
    for _ in range(20):
        eyes.rest(**off)
    assert re.search(text, eyes.drift.request)
    assert "vergence identify" in eyes.drift.request
    assert abs(eyes.drift.correction_rad) <= MOST_CORRECTED_RAD


def test_readings_that_contradict_the_joints_ask_for_identify() -> None:
    drift = MountDrift()
    for _ in range(10):
        drift.on_contradiction()
        drift.on_pan_moved()
    assert "contradicted the joints in 10 of the last 10 rests" in drift.request
    assert drift.correction_rad == 0.0
    assert not drift.known


def test_one_rest_counts_once_however_often_it_is_read() -> None:
    drift = MountDrift()
    for _ in range(50):
        drift.update(MountReading(1.0 * DEG, 0.0, 0.0))
    drift.on_pan_moved()
    drift.on_pan_moved()  # a rest without readings
    drift.update(MountReading(math.nan, 0.0, 0.0))
    drift.on_pan_moved()
    assert not drift.known
    assert drift.summary() == {}
    assert np.isnan(drift.offsets_rad).all()


def test_the_controller_corrects_a_bumped_camera_and_says_so() -> None:
    rig = default_rig()
    controller = GazeController(rig, gaze_parameters())
    bump_rad, now_s = math.radians(1.0), 10.0
    for rest in range(20):
        pan_rad = 0.02 * (-1) ** rest
        for _ in range(60):  # the eyes rest long enough to be read
            now_s += 0.02
            positions = {"pan_left": pan_rad - 0.05, "pan_right": pan_rad + 0.05, "tilt": 0.0}
            controller.step(now_s, [JointReport(now_s, positions)])
        seen = EyeRotationObservation(now_s, 0.0, 0.1 + bump_rad, 0.0005, roll_rad=0.001, pitch_rad=-0.002)
        controller.step(now_s + 0.001, [seen])
    corrected_rad = controller.mounts.correction_rad
    assert corrected_rad == pytest.approx(bump_rad, abs=math.radians(0.15))
    assert controller.step(now_s + 0.01).report.vergence_rad == pytest.approx(0.1 + corrected_rad, abs=0.01)
    assert controller.mounts.summary()["mount_vergence_corrected_deg"] == pytest.approx(1.0, abs=0.15)
    assert not controller.mounts.request
