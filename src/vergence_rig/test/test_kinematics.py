"""Kinematics: inverse and forward agree, Jacobians are those of differences, the ideal head is a special case."""

import math
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_rig import geometry as g
from vergence_rig.kinematics import FarPoint, Kinematics
from vergence_rig.rig import Rig, RigError, default_rig
from vergence_rig.rig_file import rig_as_mapping, rig_from_mapping
from vergence_rig.testing import ideal_eyes
from vergence_rig.testing.odd_heads import SHARES, odd_head

_STEP = 1e-6


def _between(limit: float, about: float = 0.0) -> st.SearchStrategy[float]:
    return st.floats(about - limit, about + limit)


_RIGS = st.lists(st.floats(-1.0, 1.0), min_size=SHARES, max_size=SHARES).map(odd_head)
_POINTS = st.tuples(st.floats(0.25, 3.0), _between(0.4), _between(0.4))


@given(_RIGS, _POINTS)
def test_both_eyes_look_at_the_point_that_they_are_turned_to(rig: Rig, point: tuple[float, float, float]) -> None:
    k = Kinematics(rig)
    eyes = k.gaze_for_point(point)
    downs = []
    for left, pan in ((True, eyes.pan_left_rad), (False, eyes.pan_right_rad)):
        ray = k.rotation_rig_from_eye(pan, eyes.tilt_rad).T @ (np.array(point) - k.lens(left, pan, eyes.tilt_rad))
        assert ray[0] > 0
        assert abs(ray[1]) < 1e-9
        downs.append(math.atan2(-ray[2], math.hypot(ray[0], ray[1])))
    # Where the lenses are at different heights no angles bring it to both foveas: the mean of both is left.
    assert sum(downs) == pytest.approx(0.0, abs=1e-4)
    assert downs[0] - downs[1] == pytest.approx(k.vertical_difference_rad(point), abs=1e-4)


@given(_RIGS, _POINTS)
def test_forward_and_inverse_agree(rig: Rig, point: tuple[float, float, float]) -> None:
    k = Kinematics(rig)
    eyes = k.gaze_for_point(point)
    assert k.point_at(eyes.version_rad, eyes.vergence_rad, eyes.tilt_rad) == pytest.approx(point, abs=1e-8)
    assert k.fixation(eyes).point_m == pytest.approx(point, abs=2e-3)


@given(_RIGS, _between(0.4), _between(0.3), st.floats(-0.05, 3.0))
def test_far_points_are_found_through_infinity(rig: Rig, y: float, z: float, w: float) -> None:
    k = Kinematics(rig)
    eyes = k.gaze(FarPoint(1.0, y, z, w))
    found = k.far_point(eyes)
    scale = 1.0 / math.hypot(found.x, found.y, found.z)
    true = 1.0 / math.hypot(1.0, y, z)
    assert np.array([found.x, found.y, found.z, found.w]) * scale == pytest.approx(
        np.array([1.0, y, z, w]) * true, abs=1e-7
    )


@given(_RIGS, _POINTS)
def test_jacobian_of_the_point_is_that_of_differences(rig: Rig, point: tuple[float, float, float]) -> None:
    k = Kinematics(rig)
    eyes = k.gaze_for_point(point)
    angles = np.array([eyes.version_rad, eyes.vergence_rad, eyes.tilt_rad])
    numeric = [(k.point_at(*(angles + d)) - k.point_at(*(angles - d))) / (2 * _STEP) for d in _STEP * np.eye(3)]
    expected = np.column_stack(numeric)
    assert k.point_jacobian(eyes) == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())


@given(_RIGS, st.booleans(), _between(0.8), _between(0.6), st.tuples(_between(1.0), _between(1.0), _between(1.0)))
def test_plain_numbers_are_those_of_the_arrays(
    rig: Rig, left: bool, pan: float, tilt: float, seen: tuple[float, float, float]
) -> None:
    k = Kinematics(rig)
    turned = k.rotation_rig_from_optical(pan, tilt) @ seen
    assert k.seen_direction(pan, tilt, *seen) == pytest.approx(tuple(turned), abs=1e-12)
    assert k.lens_place(left, pan, tilt) == tuple(k.lens(left, pan, tilt))


@given(_RIGS, st.booleans(), _between(0.8), _between(0.6))
def test_jacobian_of_the_pose_is_that_of_differences(rig: Rig, left: bool, pan: float, tilt: float) -> None:
    k = Kinematics(rig)
    moves, turns = k.pose_jacobian(left, pan, tilt)
    axis = k.axis(pan, tilt)
    for i, (dp, dt) in enumerate(((_STEP, 0.0), (0.0, _STEP))):
        lens = (k.lens(left, pan + dp, tilt + dt) - k.lens(left, pan - dp, tilt - dt)) / (2 * _STEP)
        turned = (k.axis(pan + dp, tilt + dt) - k.axis(pan - dp, tilt - dt)) / (2 * _STEP)
        assert moves[:, i] == pytest.approx(lens, abs=1e-7)
        assert np.cross(turns[:, i], axis) == pytest.approx(turned, abs=1e-7)


@given(_POINTS, st.floats(0.03, 0.2))
def test_a_head_without_offsets_has_the_formulas_of_ideal_eyes(
    point: tuple[float, float, float], baseline_m: float
) -> None:
    k = Kinematics(Rig(baseline_m=baseline_m))
    eyes, ideal = k.gaze_for_point(point), ideal_eyes.gaze_for_point(point, baseline_m)
    assert [eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad] == pytest.approx(
        [ideal.pan_left_rad, ideal.pan_right_rad, ideal.tilt_rad], abs=1e-10
    )
    assert k.axis(eyes.pan_left_rad, eyes.tilt_rad) == pytest.approx(g.eye_direction(eyes.pan_left_rad, eyes.tilt_rad))


@given(_RIGS, _between(0.5), _between(0.5), _between(0.4))
def test_eye_angles_describe_the_same_head(rig: Rig, left: float, right: float, tilt: float) -> None:
    joints = (left, right, tilt)
    eyes = rig.eye_angles(joints)
    assert rig.joint_angles(eyes) == pytest.approx(joints)
    same = rig.in_eye_angles()
    assert same.eye_angles(eyes) == pytest.approx(eyes)
    for is_left, pan in ((True, eyes[0]), (False, eyes[1])):
        at = [Kinematics(r).lens(is_left, pan, eyes[2]) for r in (rig, same)]
        assert at[0] == pytest.approx(at[1])
        # the lens by the chain of rig.yaml itself, joint by joint
        mount, joint = rig.mount(is_left), (rig.pan_left if is_left else rig.pan_right)
        pan_axis = joint.axis_rad(left if is_left else right)
        place = np.array([mount.axis_x_m, (1 if is_left else -1) * rig.baseline_m / 2, mount.axis_z_m])
        place = place + g.rotation_rig_from_eye(pan_axis, 0.0) @ (mount.lens_x_m, mount.lens_y_m, mount.lens_z_m)
        axis = np.array([rig.tilt_axis_x_m, 0.0, rig.tilt_axis_z_m])
        assert at[0] == pytest.approx(axis + g.rotation_rig_from_eye(0.0, rig.tilt.axis_rad(tilt)) @ (place - axis))
    assert same.pan_left.lower_rad == pytest.approx(
        rig.pan_left.axis_rad(rig.pan_left.lower_rad) + rig.left_mount.yaw_rad
    )


@given(_RIGS)
def test_a_rig_with_mounts_is_written_and_read(rig: Rig) -> None:
    assert rig_from_mapping(rig_as_mapping(rig)) == rig


@pytest.mark.parametrize(
    ("document", "named"),
    [
        ({"left_mount": {"lens_x_m": "far"}}, "left_mount.lens_x_m must be a number from -1 to 1"),
        ({"left_mount": {"lens_mm": 3}}, "left_mount must have no keys but axis_x_m"),
        ({"joints": {"tilt": {"scale": 0.0}}}, "joints.tilt.scale must be a number from 0.5 to 2"),
        ({"joints": {"pan_left": {"zero_rad": 3.0}}}, "joints.pan_left.zero_rad must be a number from -0.5 to 0.5"),
        ({"tilt_axis_z_m": float("nan")}, "tilt_axis_z_m must be a number from -1 to 1"),
    ],
)
def test_errors_name_the_key(document: dict[str, Any], named: str) -> None:
    with pytest.raises(RigError, match=named):
        rig_from_mapping(document)


@given(_RIGS, _between(1.5), _between(1.5), _between(0.8))
def test_any_angles_have_a_point_or_an_error(rig: Rig, version: float, vergence: float, tilt: float) -> None:
    k = Kinematics(rig)
    point = k.far_point(g.from_version_vergence(version, vergence, tilt))
    assert all(math.isfinite(value) for value in (point.x, point.y, point.z, point.w))
    with suppress(g.GeometryError):  # the axes need not meet
        assert np.isfinite(k.point_at(version, vergence, tilt)).all()


def test_points_without_a_gaze_are_refused() -> None:
    k = Kinematics(default_rig())
    for point in ((0.0, 0.5, 0.0), (math.nan, 0.0, 0.0), (math.inf, 0.0, 0.0)):
        with pytest.raises(g.UnreachableError):
            k.gaze_for_point(point)
    with pytest.raises(g.ParallelAxesError):
        k.point_at(0.1, 0.0, 0.0)
    with pytest.raises(g.DivergingAxesError):
        k.point_at(0.1, -0.01, 0.0)
