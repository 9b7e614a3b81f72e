"""Fixation geometry: the paper's case by number, round trips by hypothesis, and answers that do not exist."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig import geometry as g
from vergence_rig.paper_fixation import paper_fixation
from vergence_rig.testing import ideal_eyes as ideal

BASELINE_M = 0.065


def test_the_papers_80_80_degree_case() -> None:
    found = paper_fixation(math.radians(80), math.radians(80), BASELINE_M)
    assert math.degrees(found.vergence_rad) == pytest.approx(20)
    assert found.om_m == pytest.approx(0.5 * BASELINE_M * math.tan(math.radians(80)))
    assert found.om_m == pytest.approx(0.184317, abs=1e-6)
    assert found.distance_m == pytest.approx(found.om_m)
    assert found.c1m_m == pytest.approx(0.5 * BASELINE_M)
    assert found.y_m == pytest.approx(0, abs=1e-15)


def test_the_papers_foot_is_not_the_middle_where_the_angles_differ() -> None:
    # A right angle at C1: O stands above the left eye, and the triangle's legs are d and OM = d tan C2.
    found = paper_fixation(math.radians(90), math.radians(60), BASELINE_M)
    assert found.c1m_m == pytest.approx(0.0, abs=1e-15)
    assert found.om_m == pytest.approx(BASELINE_M * math.tan(math.radians(60)))
    assert found.distance_m == pytest.approx(math.hypot(0.5 * BASELINE_M, found.om_m))


def test_the_papers_angles_agree_with_pan_angles() -> None:
    eyes = g.EyeAngles(math.radians(-10), math.radians(10), 0.0)
    point = ideal.fixation_point(eyes, BASELINE_M).point_m
    np.testing.assert_allclose(point, [0.184317, 0, 0], atol=1e-6)


@given(st.floats(0.2, 3.0), st.floats(-1.0, 1.0), st.floats(0.03, 0.3))
@settings(deadline=None, max_examples=60)
def test_paper_fixation_equals_3d_fixation_off_axis(x: float, y: float, baseline_m: float) -> None:
    eyes = ideal.gaze_for_point((x, y, 0.0), baseline_m)
    found = paper_fixation(math.pi / 2 + eyes.pan_left_rad, math.pi / 2 - eyes.pan_right_rad, baseline_m)
    assert found.om_m == pytest.approx(x, rel=1e-6)
    assert found.y_m == pytest.approx(y, rel=1e-6, abs=1e-9)
    assert found.c1m_m == pytest.approx(0.5 * baseline_m - y, rel=1e-6, abs=1e-9)
    assert found.distance_m == pytest.approx(math.hypot(x, y), rel=1e-6)


points = st.tuples(st.floats(0.1, 5.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))


@given(points)
@settings(deadline=None, max_examples=150)
def test_point_to_gaze_to_point(point: tuple[float, float, float]) -> None:
    eyes = ideal.gaze_for_point(point, BASELINE_M)
    fixation = ideal.fixation_point(eyes, BASELINE_M)
    np.testing.assert_allclose(fixation.point_m, point, rtol=1e-6, atol=1e-7)
    # the same through the general rays of two eyes
    rays = g.fixation_of_rays(
        ideal.eye_position(True, BASELINE_M),
        g.eye_direction(eyes.pan_left_rad, eyes.tilt_rad),
        ideal.eye_position(False, BASELINE_M),
        g.eye_direction(eyes.pan_right_rad, eyes.tilt_rad),
    )
    np.testing.assert_allclose(rays.point_m, point, rtol=1e-6, atol=1e-7)
    assert rays.miss_distance_m < 1e-6


@given(st.floats(-0.8, 0.8), st.floats(0.005, 0.6), st.floats(-0.7, 0.7))
@settings(deadline=None, max_examples=150)
def test_gaze_to_point_to_gaze(version: float, vergence: float, tilt: float) -> None:
    eyes = g.from_version_vergence(version, vergence, tilt)
    again = ideal.gaze_for_point(g.point_at(version, vergence, tilt, BASELINE_M), BASELINE_M)
    assert again.version_rad == pytest.approx(version, abs=1e-9)
    assert again.vergence_rad == pytest.approx(vergence, abs=1e-9)
    assert again.tilt_rad == pytest.approx(tilt, abs=1e-9)
    assert again.pan_left_rad == pytest.approx(eyes.pan_left_rad, abs=1e-9)


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
@settings(deadline=None, max_examples=100)
def test_the_axis_of_an_eye_is_forward_in_its_rotation(pan: float, tilt: float) -> None:
    rotation = g.rotation_rig_from_eye(pan, tilt)
    np.testing.assert_allclose(rotation[:, 0], g.eye_direction(pan, tilt), atol=1e-15)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_signs_of_the_axes() -> None:
    assert g.eye_direction(0.3, 0.0)[1] > 0  # pan > 0 looks left
    assert g.eye_direction(0.0, 0.3)[2] < 0  # tilt > 0 looks down
    assert ideal.eye_position(True, BASELINE_M)[1] > 0
    np.testing.assert_allclose(g.rotation_rig_from_optical(0, 0) @ [0, 0, 1], [1, 0, 0])
    np.testing.assert_allclose(g.rotation_rig_from_optical(0, 0) @ [1, 0, 0], [0, -1, 0])


@pytest.mark.parametrize(("vergence", "error"), [(0.0, g.ParallelAxesError), (-0.05, g.DivergingAxesError)])
def test_parallel_and_diverging_axes_are_reported(vergence: float, error: type[Exception]) -> None:
    eyes = g.from_version_vergence(0.1, vergence, 0.2)
    with pytest.raises(error):
        ideal.fixation_point(eyes, BASELINE_M)
    with pytest.raises(error):
        paper_fixation(math.pi / 2 + eyes.pan_left_rad, math.pi / 2 - eyes.pan_right_rad, BASELINE_M)
    with pytest.raises(error):
        g.nearest_points_of_rays(
            ideal.eye_position(True, BASELINE_M),
            g.eye_direction(eyes.pan_left_rad, 0.2),
            ideal.eye_position(False, BASELINE_M),
            g.eye_direction(eyes.pan_right_rad, 0.2),
        )


def test_rays_that_pass_each_other() -> None:
    left, right = g.nearest_points_of_rays((0, 0.1, 0.01), (1, -0.1, 0), (0, -0.1, -0.01), (1, 0.1, 0))
    np.testing.assert_allclose(left, [1, 0, 0.01], atol=1e-12)
    np.testing.assert_allclose(right, [1, 0, -0.01], atol=1e-12)
    fixation = g.fixation_of_rays((0, 0.1, 0.01), (1, -0.1, 0), (0, -0.1, -0.01), (1, 0.1, 0))
    np.testing.assert_allclose(fixation.point_m, [1, 0, 0], atol=1e-12)
    assert fixation.miss_distance_m == pytest.approx(0.02)


@pytest.mark.parametrize("point", [(0, 0, 0), (0, 1, 0), (math.nan, 0, 0), (math.inf, 0, 0)])
def test_points_that_no_gaze_reaches(point: tuple[float, float, float]) -> None:
    with pytest.raises(g.UnreachableError):
        ideal.gaze_for_point(point, BASELINE_M)


@pytest.mark.parametrize("angle", [0.0, -0.1, math.pi, math.nan])
def test_paper_angles_out_of_range(angle: float) -> None:
    with pytest.raises(g.GeometryError):
        paper_fixation(angle, 1.0, BASELINE_M)
