"""Which pairs are measured: two in a row at the wanted rate, of eyes and a head at rest."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.eye_rotation.encoder import EyeRotationStatus, VisualEncoder
from vergence_metric.eye_rotation.pair_selection import PairSelection
from vergence_metric.eye_rotation.parameters import EncoderParameters, RestParameters
from vergence_metric.eye_rotation.resting_pairs import measure_pair
from vergence_metric.pairs.pairing import Pair
from vergence_rig.camera import CameraModel
from vergence_rig.joint_history import JointHistory
from vergence_rig.rig import JOINT_NAMES, default_rig

MS = 1_000_000
RIG = default_rig()
MODELS = (CameraModel(RIG.left_camera), CameraModel(RIG.right_camera))


def chosen(stamps_ms: list[float], rate_hz: float) -> list[tuple[int, int]]:
    selection: PairSelection[int] = PairSelection(rate_hz)
    found = []
    for stamp_ns in (round(value * MS) for value in stamps_ms):
        if selection.is_due(stamp_ns):
            two = selection.add(stamp_ns, stamp_ns)
            if two is not None:
                found.append(two)
    return found


@pytest.mark.parametrize("rate_hz", [1.0, 3.0, 5.0])
def test_two_pairs_in_a_row_are_taken_at_the_rate(rate_hz: float) -> None:
    stamps = [i * 1000 / 30 for i in range(300)]
    taken = chosen(stamps, rate_hz)
    assert len(taken) == pytest.approx(10 * rate_hz, abs=2)
    assert all(later - earlier == pytest.approx(33.3 * MS, abs=MS) for earlier, later in taken)


def test_slow_cameras_give_what_they_can() -> None:
    assert len(chosen([i * 200 for i in range(50)], 3.0)) == pytest.approx(25, abs=1)
    assert chosen([i * 900 for i in range(20)], 3.0) == []


def test_a_clock_set_back_begins_anew() -> None:
    later = [100_000 + i * 33.0 for i in range(10)]
    assert chosen([*later, *(i * 33.0 for i in range(10))], 3.0)[-1][0] < 1000 * MS


@settings(deadline=None, max_examples=50)
@given(
    steps=st.lists(st.floats(1.0, 2000.0), min_size=2, max_size=200),
    rate_hz=st.floats(0.2, 30.0),
)
def test_never_more_often_than_the_rate(steps: list[float], rate_hz: float) -> None:
    firsts = [first for first, _ in chosen(np.cumsum(steps).tolist(), rate_hz)]
    assert all(later - earlier >= 1e9 / rate_hz - 1 for earlier, later in pairwise(firsts))


@dataclass
class Frame:
    pixels: np.ndarray


def scene(shift_px: int) -> np.ndarray:
    random = np.random.default_rng(2)
    small = random.integers(0, 256, (48, 80)).astype(np.uint8)
    return np.ascontiguousarray(np.kron(small, np.ones((10, 10), np.uint8))[:, shift_px : shift_px + 640])


def joints(pan_at: dict[int, float]) -> JointHistory:
    history = JointHistory()
    for stamp_ms, pan in pan_at.items():
        history.add(stamp_ms * MS, JOINT_NAMES, (pan, pan, 0.0))
    return history


RESTING = dict.fromkeys(range(0, 1001, 20), 0.1)


def status(history: JointHistory, shift_px: int = 0, skew_ms: int = 7):
    encoder = VisualEncoder(EncoderParameters(), RIG)
    before = Pair(Frame(scene(0)), Frame(scene(0)), 867 * MS, (867 + skew_ms) * MS)
    pair = Pair(Frame(scene(shift_px)), Frame(scene(shift_px)), 900 * MS, (900 + skew_ms) * MS)
    return measure_pair(encoder, RestParameters(), before, pair, history, MODELS)


def test_resting_eyes_are_measured() -> None:
    assert status(joints(RESTING)).status not in (
        EyeRotationStatus.MOVING,
        EyeRotationStatus.NO_JOINTS,
        EyeRotationStatus.NO_CAMERA_INFO,
    )


@pytest.mark.parametrize("moved_at_ms", [760, 840, 900, 906])
def test_eyes_that_moved_shortly_before_or_between_the_exposures_are_not(moved_at_ms: int) -> None:
    pans = {stamp: 0.1 if stamp < moved_at_ms else 0.15 for stamp in RESTING}
    reading = status(joints(pans))
    assert reading.status is EyeRotationStatus.MOVING
    assert "degrees" in reading.reason


def test_eyes_that_moved_long_ago_are() -> None:
    pans = {stamp: 0.1 if stamp < 500 else 0.15 for stamp in RESTING}
    assert status(joints(pans)).status is not EyeRotationStatus.MOVING


def test_a_head_that_turns_is_not_measured() -> None:
    reading = status(joints(RESTING), shift_px=5)
    assert reading.status is EyeRotationStatus.MOVING
    assert "px a second" in reading.reason
    assert math.isfinite(reading.joint_vergence_rad)


def test_without_joints_or_cameras_there_is_no_reading() -> None:
    assert status(JointHistory()).status is EyeRotationStatus.NO_JOINTS
    assert status(joints({0: 0.1, 20: 0.1})).status is EyeRotationStatus.NO_JOINTS
    assert status(joints({890: 0.1, 910: 0.1})).status is EyeRotationStatus.MOVING
    pair = Pair(Frame(scene(0)), Frame(scene(0)), 900 * MS, 900 * MS)
    reading = measure_pair(VisualEncoder(EncoderParameters(), RIG), RestParameters(), pair, pair, joints(RESTING), None)
    assert reading.status is EyeRotationStatus.NO_CAMERA_INFO
