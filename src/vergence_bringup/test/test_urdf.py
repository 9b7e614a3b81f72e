"""The URDF describes the same head as rig.yaml: same joints, limits, baseline and axes."""

import dataclasses
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from vergence_bringup.launching.head_urdf import head_urdf
from vergence_rig.geometry import eye_position, rotation_rig_from_optical
from vergence_rig.rig import JOINT_NAMES, default_rig

URDF = Path(__file__).resolve().parent.parent / "urdf" / "vergence_head.urdf"


@pytest.fixture
def joints():
    root = ElementTree.parse(URDF).getroot()
    return {joint.attrib["name"]: joint for joint in root.iter("joint")}


def _numbers(element, name, default="0 0 0"):
    return np.array(
        [float(word) for word in (element.attrib.get(name, default) if element is not None else default).split()]
    )


def _rotation(axis, angle):
    x, y, z = axis
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def _fixed(origin):
    roll, pitch, yaw = _numbers(origin, "rpy")
    return _rotation((0, 0, 1), yaw) @ _rotation((0, 1, 0), pitch) @ _rotation((1, 0, 0), roll)


def test_limits_are_the_rigs(joints):
    rig = default_rig()
    for name in JOINT_NAMES:
        limit = joints[name].find("limit").attrib
        joint = rig.joints[name]
        found = [float(limit[key]) for key in ("lower", "upper", "velocity")]
        assert found == pytest.approx([joint.lower_rad, joint.upper_rad, joint.max_speed_rad_s])


def test_the_urdf_of_another_rig_has_its_baseline_and_limits():
    rig = default_rig()
    pan = dataclasses.replace(rig.joints.pan_left, lower_rad=-0.5, max_speed_rad_s=2.0)
    rig = dataclasses.replace(rig, baseline_m=0.08, joints=dataclasses.replace(rig.joints, pan_left=pan))
    root = ElementTree.fromstring(head_urdf(URDF.read_text(encoding="utf-8"), rig))
    joints = {joint.attrib["name"]: joint for joint in root.iter("joint")}
    assert _numbers(joints["pan_left"].find("origin"), "xyz") == pytest.approx([0, 0.04, 0])
    assert _numbers(joints["pan_right"].find("origin"), "xyz") == pytest.approx([0, -0.04, 0])
    limit = joints["pan_left"].find("limit")
    assert limit is not None
    assert (float(limit.attrib["lower"]), float(limit.attrib["velocity"])) == (-0.5, 2.0)


@pytest.mark.parametrize("eye", ["left", "right"])
def test_forward_kinematics_are_the_rigs(joints, eye):
    pan_rad, tilt_rad = 0.31, -0.22
    tilt, pan, optical = joints["tilt"], joints[f"pan_{eye}"], joints[f"{eye}_camera_optical_joint"]
    rotation = _rotation(_numbers(tilt.find("axis"), "xyz"), tilt_rad)
    position = rotation @ _numbers(pan.find("origin"), "xyz")
    rotation = rotation @ _rotation(_numbers(pan.find("axis"), "xyz"), pan_rad) @ _fixed(optical.find("origin"))
    assert position == pytest.approx(eye_position(eye == "left", default_rig().baseline_m))
    assert rotation == pytest.approx(rotation_rig_from_optical(pan_rad, tilt_rad), abs=1e-9)
