"""Pulses to angles and back, and what servos.yaml may say."""

import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.rig import default_rig
from vergence_servo.calibration import (
    ServoCalibration,
    ServoCalibrationError,
    default_servos,
    load_servos,
    servo_limits,
    servos_from_mapping,
)

CONFIG = Path(__file__).parents[3] / "config"


def test_sg90_turns_0_09_degree_per_microsecond():
    servo = default_servos()["pan_left"]
    assert servo.pulse_us(0.0) == pytest.approx(1500.0)
    assert math.degrees(servo.joint_rad(1600.0)) == pytest.approx(9.0)
    assert math.degrees(servo.step_rad(4.88)) == pytest.approx(0.4392)


def test_sign_and_trim_turn_and_shift_the_joint():
    servo = ServoCalibration(channel=0, sign=-1, trim_rad=0.1)
    assert servo.pulse_us(0.0) > 1500.0
    assert servo.pulse_us(0.2) < servo.pulse_us(0.0)
    assert servo.joint_rad(1500.0) == pytest.approx(0.1)


@settings(deadline=None, max_examples=200)
@given(
    angle=st.floats(-1.5, 1.5),
    sign=st.sampled_from([1, -1]),
    trim=st.floats(-0.5, 0.5),
    middle_us=st.floats(1300, 1700),
)
def test_pulse_and_angle_are_inverse(angle: float, sign: int, trim: float, middle_us: float):
    servo = ServoCalibration(
        channel=0, angles_rad=(-1.0, 0.0, 1.0), pulses_us=(900.0, middle_us, 2100.0), sign=sign, trim_rad=trim
    )
    assert servo.joint_rad(servo.pulse_us(angle)) == pytest.approx(angle, abs=1e-9)


def test_shipped_file_equals_the_built_in_servos():
    assert load_servos(CONFIG / "servos.yaml") == default_servos() == load_servos("")


def test_limits_are_the_narrowest_of_servo_and_rig():
    rig = default_rig()
    servo = ServoCalibration(channel=0, maximum_us=1600.0, lower_rad=-0.2, speed_rad_s=30.0)
    limits = servo_limits("pan_left", servo, rig.joints["pan_left"])
    assert limits.upper_rad == pytest.approx(math.radians(9.0))
    assert limits.lower_rad == pytest.approx(-0.2)
    assert limits.max_speed_rad_s == pytest.approx(rig.joints["pan_left"].max_speed_rad_s)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"channel": None}, "channel"),
        ({"channel": -1}, "from 0 to 63"),
        ({"sign": 0}, "1 or -1"),
        ({"angles_rad": [0.0]}, "two or more"),
        ({"angles_rad": [0.5, -0.5]}, "above the last"),
        ({"pulses_us": [1000.0, 1500.0, 2000.0]}, "as many as angles_rad"),
        ({"pulses_us": [2000.0, 1000.0]}, "sign: -1"),
        ({"pulses_us": [1500.0, 1501.0]}, "us per rad"),
        ({"minimum_us": 2000.0, "maximum_us": 1000.0}, "more than minimum_us"),
        ({"lower_rad": 1.0, "upper_rad": 0.0}, "more than lower_rad"),
        ({"trim_rad": float("nan")}, "trim_rad"),
        ({"chanel": 1}, "one of "),
        ({"channel": True}, "channel"),
    ],
)
def test_nonsense_is_refused_by_name(change: dict[str, Any], text: str):
    entries = {key: value for key, value in ({"channel": 3} | change).items() if value is not None}
    with pytest.raises(ServoCalibrationError, match=r"servos\.tilt") as caught:
        servos_from_mapping({"servos": {"tilt": entries}})
    assert text in str(caught.value)


@pytest.mark.parametrize(
    "document", [None, [], {"servo": {}}, {"servos": {}}, {"servos": [1]}, {"servos": {"tilt": 3}}]
)
def test_other_documents_are_refused(document: Any, tmp_path: Path):
    path = tmp_path / "servos.yaml"
    path.write_text(yaml.safe_dump(document))
    with pytest.raises(ServoCalibrationError, match=r"servos\.yaml"):
        load_servos(path)


def test_two_servos_on_one_channel_are_refused():
    with pytest.raises(ServoCalibrationError, match="different channel"):
        servos_from_mapping({"servos": {"tilt": {"channel": 1}, "pan_left": {"channel": 1}}})


def test_limits_that_leave_nothing_are_refused():
    servo = ServoCalibration(channel=0, minimum_us=600.0, maximum_us=610.0)
    with pytest.raises(ServoCalibrationError, match="no range of motion"):
        servo_limits("tilt", servo, default_rig().joints["tilt"])


def test_unreadable_files_are_named(tmp_path: Path):
    with pytest.raises(ServoCalibrationError, match="nowhere"):
        load_servos(tmp_path / "nowhere.yaml")
    broken = tmp_path / "broken.yaml"
    broken.write_text("servos: [")
    with pytest.raises(ServoCalibrationError, match="is not YAML"):
        load_servos(broken)
