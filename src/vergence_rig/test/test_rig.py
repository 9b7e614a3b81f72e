"""The rig's description: defaults, YAML, and errors that name the key, the value and what is allowed."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from vergence_rig.rig import JOINT_NAMES, JointSpec, Rig, RigError, default_rig
from vergence_rig.rig_file import load_rig, rig_as_mapping, rig_from_mapping, write_rig
from vergence_rig.servo import IDEAL, MG995, SG90
from vergence_rig.testing.odd_heads import SHARES, odd_head

CONFIG = Path(__file__).resolve().parents[3] / "config" / "rig.yaml"


def test_shipped_yaml_is_the_built_in_rig_of_a_head_not_yet_identified() -> None:
    assert load_rig(CONFIG) == replace(default_rig(), zero_sigma_rad=0.05)


def test_empty_path_is_the_built_in_rig() -> None:
    assert load_rig("") == default_rig()


def test_default_rig_is_the_papers_second_design() -> None:
    rig = default_rig()
    assert rig.baseline_m == 0.065
    assert (rig.pan_left.servo, rig.pan_right.servo, rig.tilt.servo) == (SG90, SG90, MG995)
    assert math.degrees(rig.pan_left.upper_rad) == pytest.approx(60)
    assert tuple(name for name, _ in rig.joints.items()) == JOINT_NAMES


@pytest.mark.parametrize(
    ("document", "named"),
    [
        ({"baseline": 0.1}, ["baseline", "baseline_m"]),
        ({"baseline_m": -0.1}, ["baseline_m", "-0.1", "0.001"]),
        ({"baseline_m": "wide"}, ["baseline_m", "wide", "number"]),
        ({"baseline_m": True}, ["baseline_m", "True", "number"]),
        ({"baseline_m": float("nan")}, ["baseline_m", "nan"]),
        ({"left_camera": {"fx_px": 0}}, ["left_camera.fx_px", "got 0", "from 1", "px"]),
        ({"left_camera": {"width_px": 640.5}}, ["left_camera.width_px", "640.5", "whole"]),
        ({"right_camera": {"distortion": [0.1, 0.2]}}, ["right_camera.distortion", "five"]),
        ({"right_camera": {"focal": 3}}, ["right_camera", "focal", "fx_px"]),
        ({"joints": {"pan": {}}}, ["joints", "'pan'", "pan_left"]),
        ({"joints": {"tilt": {"lower_rad": 1.0, "upper_rad": 0.5}}}, ["joints.tilt.upper_rad", "0.5", "lower_rad"]),
        ({"joints": {"tilt": {"servo": "sg91"}}}, ["joints.tilt.servo", "sg91", "'sg90'"]),
        ({"joints": {"tilt": {"servo": {"dead_band_rad": -1}}}}, ["joints.tilt.servo.dead_band_rad", "-1"]),
        ({"minimum_vergence_rad": -0.1}, ["minimum_vergence_rad", "-0.1"]),
        ([1, 2], ["rig", "mapping"]),
        (None, ["rig", "mapping"]),
    ],
)
def test_errors_name_key_value_and_allowed(document: object, named: list[str]) -> None:
    with pytest.raises(RigError) as caught:
        rig_from_mapping(document)
    for part in named:
        assert part in str(caught.value)


def test_unreadable_and_malformed_files_name_the_file(tmp_path: Path) -> None:
    with pytest.raises(RigError, match="nowhere"):
        load_rig(tmp_path / "nowhere.yaml")
    broken = tmp_path / "broken.yaml"
    broken.write_text("baseline_m: [", encoding="utf-8")
    with pytest.raises(RigError, match=r"broken\.yaml' is not YAML"):
        load_rig(broken)
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RigError, match=r"binary\.yaml"):
        load_rig(binary)


def test_a_servo_may_be_given_by_its_figures() -> None:
    rig = rig_from_mapping({"joints": {"tilt": {"servo": {"name": "mine", "dead_band_rad": 0.01}}}})
    assert (rig.tilt.servo.name, rig.tilt.servo.dead_band_rad) == ("mine", 0.01)


def test_with_servos_changes_servos_and_speeds_only() -> None:
    rig = default_rig().with_servos(IDEAL)
    assert rig.tilt.servo is IDEAL
    assert rig.tilt.max_speed_rad_s == IDEAL.speed_rad_s
    assert rig.left_camera == default_rig().left_camera


def test_minimum_vergence_must_be_within_the_joints() -> None:
    with pytest.raises(RigError, match="minimum_vergence_rad"):
        rig_from_mapping(
            {
                "minimum_vergence_rad": 0.5,
                "joints": {"pan_left": {"lower_rad": -0.2}, "pan_right": {"upper_rad": 0.2}},
            }
        )


def test_clamp_holds_the_joint_limits() -> None:
    joint = JointSpec(-0.5, 0.4, 1.0, IDEAL)
    assert [joint.clamp(angle) for angle in (-2.0, 0.1, math.inf)] == [-0.5, 0.1, 0.4]


def test_rigs_are_frozen_and_comparable() -> None:
    with pytest.raises(AttributeError):
        Rig().baseline_m = 1.0  # type: ignore[misc]


def test_a_rig_as_mapping_gives_the_same_rig() -> None:
    slow = SG90.replaced(name="mine", speed_rad_s=7.5, command_latency_s=0.03)
    for rig in (default_rig(), default_rig().with_servos(slow, MG995), Rig(baseline_m=0.1, minimum_vergence_rad=0.02)):
        assert rig_from_mapping(rig_as_mapping(rig)) == rig
        assert rig_from_mapping(rig_as_mapping(rig) | {"identified": {"anything": 1}}) == rig


def test_a_rig_that_is_written_is_read_again(tmp_path: Path) -> None:
    rig = odd_head([0.3, -0.7] * (SHARES // 2) + [0.5])
    write_rig(tmp_path / "new" / "rig.yaml", rig)
    assert load_rig(tmp_path / "new" / "rig.yaml") == rig
