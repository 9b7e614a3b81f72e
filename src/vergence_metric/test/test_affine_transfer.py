"""Affine transfer: a fixed point stays where it is whichever corners are seen; the structure is found by turning."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_metric.tracking.affine_transfer import AffineCamera, AffineStructure
from vergence_metric.tracking.common_motion import common_motion
from vergence_metric.tracking.direction_filter import DirectionFilter

RELIEF = 0.1
EXACT = np.zeros(40)


def turned(angle_rad, origin_px=(320.0, 240.0)):
    """The affine view of a structure that has turned about the vertical."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return AffineCamera(np.array([[c, 0.0, s], [0.0, 1.0, 0.0]]), np.array(origin_px))


def structure(seed, count=40):
    return np.random.default_rng(seed).uniform(-30.0, 30.0, (count, 3))


@given(seed=st.integers(0, 1000), kept=st.integers(8, 40), angle_deg=st.floats(-3.0, 3.0))
def test_the_fixed_point_does_not_move_when_corners_come_and_go(seed, kept, angle_deg):
    points, true = structure(seed), turned(np.radians(angle_deg), (331.0, 236.0))
    camera = turned(0.0)
    seen = np.random.default_rng(seed + 1).permutation(40)[:kept]
    agree = camera.fit(points[seen], EXACT[seen], true.project(points[seen]))
    # With few corners the shape that is expected counts: by two thirds of a pixel at worst.
    assert agree.sum() >= kept - 1
    np.testing.assert_allclose(camera.origin_px, true.origin_px, atol=1.0)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_with_fewer_corners_than_a_camera_needs_it_keeps_its_shape_and_moves_with_them(count):
    points, camera = structure(3), turned(0.2)
    before = camera.matrix.copy()
    camera.fit(points[:count], EXACT[:count], camera.project(points[:count]) + np.array([7.0, -4.0]))
    np.testing.assert_allclose(camera.origin_px, (327.0, 236.0), atol=0.1)
    np.testing.assert_allclose(camera.matrix, before, atol=0.01)


def test_coplanar_corners_leave_the_depth_column_as_it_was():
    points = structure(4)
    points[:, 2] = 0.0
    camera, true = turned(0.1), turned(0.12, (325.0, 241.0))
    camera.fit(points, EXACT, true.project(points))
    assert camera.matrix[0, 2] == pytest.approx(np.sin(0.1), abs=1e-6)
    np.testing.assert_allclose(camera.matrix[:, :2], true.matrix[:, :2], atol=0.01)


def test_corners_of_something_else_do_not_count():
    points, camera, true = structure(5), turned(0.0), turned(0.02, (322.0, 240.0))
    pixels = true.project(points)
    pixels[:15] += (9.0, 5.0)
    agree = camera.fit(points, EXACT, pixels)
    assert not agree[:15].any()
    assert agree[15:].all()
    np.testing.assert_allclose(camera.origin_px, true.origin_px, atol=0.1)


def test_two_eyes_give_the_structure_and_turning_makes_its_depth_sharper():
    points = structure(6)
    left, right = turned(0.0), AffineCamera(np.array([[1.0, 0.0, -RELIEF], [0.0, 1.0, 0.0]]), np.array([300.0, 240.0]))
    found = AffineStructure(20.0)
    which = found.append(40)
    found.observe(which, left, left.project(points))
    found.observe(which, right, right.project(points))
    np.testing.assert_allclose(found.points[:, :2], points[:, :2], atol=0.2)
    before = found.depth_variance.copy()
    for angle_deg in (10.0, 20.0, 30.0):
        camera = turned(np.radians(angle_deg))
        found.observe(which, camera, camera.project(points))
    assert (found.depth_variance < 0.1 * before).all()
    np.testing.assert_allclose(found.points, points, atol=0.5)


def test_most_corners_agree_on_their_motion_though_each_has_rivals():
    rng = np.random.default_rng(7)
    rivals = rng.uniform(-40.0, 40.0, (300, 2))
    assert common_motion(np.empty((0, 2)), 40.0) == pytest.approx((0.0, 0.0))
    true = np.array([13.0, -8.0])
    offsets = np.concatenate([rivals, true + rng.normal(0.0, 0.4, (25, 2))])
    assert common_motion(offsets, 40.0) == pytest.approx(true, abs=0.5)


def test_a_direction_at_constant_speed_is_predicted_and_a_hidden_one_slows_down():
    rate = np.array([0.3, -0.1])
    filters = DirectionFilter(np.zeros((2, 2)), 0.001)
    for k in range(1, 40):
        filters.predict(1 / 30)
        filters.update(np.arange(2), np.tile(rate * k / 30, (2, 1)))
    np.testing.assert_allclose(filters.rates, [rate, rate], atol=0.02)
    there = filters.angles[0].copy()
    for _ in range(90):
        filters.predict(1 / 30, coasting=True)
    # Velocity that halves every 0.7 s carries it about a second's way.
    assert np.linalg.norm(filters.angles[0] - there) == pytest.approx(np.linalg.norm(rate) * 0.96, rel=0.1)
    assert filters.sigma_rad[0] > 0.001
