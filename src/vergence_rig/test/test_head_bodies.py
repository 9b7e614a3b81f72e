"""URDF and bodies of a head, by a small forward kinematics of their own, against `Kinematics`."""

import math
import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.head_bodies import OPTICAL_FRAMES, head_bodies
from vergence_rig.head_urdf import head_urdf
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import JOINT_NAMES, Rig, default_rig
from vergence_rig.testing.odd_heads import SHARES, odd_head

Array = npt.NDArray[np.float64]
_RIGS = st.lists(st.floats(-1.0, 1.0), min_size=SHARES, max_size=SHARES).map(odd_head)
_ANGLES = st.tuples(*(st.floats(-0.6, 0.6) for _ in JOINT_NAMES))


def _turned(axis: Array, angle: float) -> Array:
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * skew + (1 - math.cos(angle)) * skew @ skew)


def _numbers(element: Any, name: str) -> Array:
    text = "0 0 0" if element is None else element.attrib.get(name, "0 0 0")
    return np.array([float(word) for word in text.split()])


def _pose(urdf: ElementTree.Element, link: str, positions: dict[str, float]) -> tuple[Array, Array]:
    """Return the place (3,) and rotation (3, 3) of a link in the root link, as robot_state_publisher computes them."""
    place, rotation = np.zeros(3), np.eye(3)
    joints = {joint.find("child").attrib["link"]: joint for joint in urdf.iter("joint")}  # type: ignore[union-attr]
    while link in joints:
        joint = joints[link]
        origin, mimic, axis = joint.find("origin"), joint.find("mimic"), joint.find("axis")
        roll, pitch, yaw = _numbers(origin, "rpy")
        turn = _turned(np.eye(3)[2], yaw) @ _turned(np.eye(3)[1], pitch) @ _turned(np.eye(3)[0], roll)
        if axis is not None:
            angle = positions.get(joint.attrib["name"], 0.0)
            if mimic is not None:
                words = mimic.attrib
                angle = float(words["multiplier"]) * positions[words["joint"]] + float(words["offset"])
            turn = turn @ _turned(_numbers(axis, "xyz"), angle)
        place, rotation = _numbers(origin, "xyz") + turn @ place, turn @ rotation
        link = joint.find("parent").attrib["link"]  # type: ignore[union-attr]
    assert link == "rig_base"
    return place, rotation


@given(_RIGS, _ANGLES)
@settings(deadline=None)
def test_the_optical_frames_are_where_the_kinematics_have_the_cameras(rig: Rig, joints: tuple[float, ...]) -> None:
    urdf = ElementTree.fromstring(head_urdf(rig))
    kinematics, eyes = Kinematics(rig), rig.eye_angles(joints)
    for eye, pan in zip(("left", "right"), eyes, strict=False):
        place, rotation = _pose(urdf, OPTICAL_FRAMES[eye], dict(zip(JOINT_NAMES, joints, strict=True)))
        assert place == pytest.approx(kinematics.lens(eye == "left", pan, eyes[2]), abs=1e-12)
        assert rotation == pytest.approx(kinematics.rotation_rig_from_camera(eye == "left", pan, eyes[2]), abs=1e-12)


@given(_RIGS)
@settings(deadline=None)
def test_the_joints_have_the_rigs_limits(rig: Rig) -> None:
    joints = {joint.attrib["name"]: joint for joint in ElementTree.fromstring(head_urdf(rig)).iter("joint")}
    for name, spec in rig.joints.items():
        limit = joints[name].find("limit")
        assert limit is not None
        assert joints[name].find("mimic") is None
        found = [float(limit.attrib[key]) for key in ("lower", "upper", "velocity")]
        assert found == [spec.lower_rad, spec.upper_rad, spec.max_speed_rad_s]


def test_a_head_as_drawn_needs_no_mimic_joint() -> None:
    urdf = ElementTree.fromstring(head_urdf(default_rig()))
    assert list(urdf.iter("mimic")) == []
    turning = {joint.attrib["name"] for joint in urdf.iter("joint") if joint.attrib["type"] == "revolute"}
    assert turning == set(JOINT_NAMES)


def test_parents_stand_before_their_children_and_no_name_twice() -> None:
    names: list[str] = []
    for body in head_bodies(default_rig()):
        assert body.parent in names or not names
        names.append(body.name)
    shapes = [shape.name for body in head_bodies(default_rig()) for shape in body.shapes]
    assert len({*names, *shapes}) == len(names) + len(shapes)
