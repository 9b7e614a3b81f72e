"""Which boxes are one object's, which object is the target, and what its corners say."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.boxes.assignment import optimal_assignment
from vergence_metric.boxes.association import associate
from vergence_metric.boxes.corner_metric import corner_metric, hidden_sides
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.pair_geometry import PairGeometry
from vergence_metric.boxes.parameters import AssociationParameters
from vergence_metric.boxes.patch_descriptor import descriptor_correlation, patch_descriptor
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, rotation_rig_from_optical
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
from vergence_rig.testing.ideal_eyes import gaze_for_point

P = AssociationParameters()
CUT_LEFT, CUT_TOP, CUT_RIGHT, CUT_BOTTOM = ((i == 0, i == 1, i == 2, i == 3) for i in range(4))


def box(x, y, width=60.0, height=60.0, score=0.8, class_id=0, cut=(False,) * 4):
    xyxy = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
    return Box(xyxy, score, class_id, f"class{class_id}", cut)


def geometry(eyes=None):
    rig = default_rig()
    return PairGeometry(
        CameraModel(rig.left_camera), CameraModel(rig.right_camera), eyes or EyeAngles(0.0, 0.0, 0.0), Kinematics(rig)
    )


def test_the_best_score_is_not_the_partner():
    left = [box(300, 200)]
    right = [box(280, 320, score=0.99), box(270, 203, score=0.4)]
    found = associate(left, right, P)
    assert [(p.left, p.right) for p in found.pairs] == [(left[0], right[1])]
    assert found.right_only == (right[0],)
    assert not found.pairs[0].ambiguous


@pytest.mark.parametrize(
    "other",
    [
        box(270, 200, class_id=1),
        box(270, 240),
        box(270, 200, height=120),
        box(-60, 200),
    ],
    ids=["class", "row", "height", "disparity"],
)
def test_what_cannot_be_one_object_is_no_pair(other):
    left = box(300, 200)
    found = associate([left], [other], P)
    assert found.pairs == ()
    assert found.left_only == (left,)
    assert found.right_only == (other,)


def test_mounts_vertical_offset_is_allowed_for():
    left, right = box(300, 200), box(270, 175)
    assert not associate([left], [right], P).pairs
    assert associate([left], [right], P, vertical_px=25.0).pairs


def test_alike_boxes_that_fit_as_well_are_ambiguous():
    found = associate([box(300, 200)], [box(270, 200), box(200, 201)], P)
    assert len(found.pairs) == 1
    assert found.pairs[0].ambiguous


def test_what_the_boxes_hold_settles_it():
    rng = np.random.default_rng(2)
    patches = rng.integers(0, 255, (2, 60, 60, 3)).astype(np.uint8)
    images = [np.full((480, 640, 3), 90, np.uint8) for _ in range(2)]
    places = ((300, 420), (180, 250))
    for image, xs, order in ((images[0], places[0], (0, 1)), (images[1], places[1], (0, 1))):
        for x, number in zip(xs, order, strict=True):
            image[170:230, x - 30 : x + 30] = patches[number]
    # The right eye is brighter and bluer.
    images[1] = np.clip(images[1] * np.array([0.7, 0.9, 0.8]) + 20, 0, 255).astype(np.uint8)
    left = [box(x - 0.5, 199.5) for x in places[0]]
    right = [box(x - 0.5, 199.5) for x in reversed(places[1])]
    found = associate(left, right, P, images=(images[0], images[1]))
    assert {(p.left.center_px[0], p.right.center_px[0]) for p in found.pairs} == {(299.5, 179.5), (419.5, 249.5)}
    assert not any(p.ambiguous for p in found.pairs)
    same = descriptor_correlation(patch_descriptor(images[0], left[0]), patch_descriptor(images[1], right[1]))
    assert same is not None
    assert same > 0.95


def test_two_alike_things_of_which_each_eye_misses_one_are_no_pair():
    rng = np.random.default_rng(4)
    one = rng.integers(0, 255, (6, 6, 3), np.uint8).repeat(10, 0).repeat(10, 1)
    other = one[::-1, ::-1, ::-1]
    left, right = box(300, 200), box(270, 201)
    images = [np.full((480, 640, 3), 120, np.uint8) for _ in range(2)]
    images[0][171:231, 271:331] = one
    images[1][172:232, 241:301] = other
    assert associate([left], [right], P).pairs
    found = associate([left], [right], P, 0.0, (images[0], images[1]))
    assert (found.pairs, found.left_only, found.right_only) == ((), (left,), (right,))
    images[1][172:232, 241:301] = one
    assert associate([left], [right], P, 0.0, (images[0], images[1])).pairs


def test_nothing_lies_beyond_infinity():
    parallel = geometry()
    assert parallel.parallel_px((300.0, 200.0)) == pytest.approx(0.0, abs=1e-9)
    far = [box(270, 200)], [box(300, 200)]
    assert not associate(*far, P, geometry=parallel).pairs
    converged = geometry(EyeAngles(-0.1, 0.1, 0.0))
    assert converged.parallel_px((319.5, 239.5)) == pytest.approx(-539 * math.tan(0.2), rel=1e-6)
    assert associate(*far, P, geometry=converged).pairs


@settings(deadline=None, max_examples=60)
@given(
    st.floats(0.25, 3.0), st.floats(-0.25, 0.25), st.floats(-0.2, 0.2), st.floats(-0.3, 0.3), st.floats(0.01, 0.3),
    st.floats(-0.3, 0.3),
)  # fmt: skip
def test_epipolar_lines_pass_where_points_are_seen(distance, y, z, version, vergence, tilt):
    """A point projected with nothing but rotations lies on the line that the geometry names."""
    eyes = EyeAngles(version - vergence / 2, version + vergence / 2, tilt)
    setup = geometry(eyes)
    point = np.array([distance, distance * y, distance * z])
    pixels = []
    for left_eye, pan in ((True, eyes.pan_left_rad), (False, eyes.pan_right_rad)):
        origin = np.array([0.0, 0.0325 if left_eye else -0.0325, 0.0])
        local = rotation_rig_from_optical(pan, tilt).T @ (point - origin)
        if local[2] < 0.05:
            return
        pixels.append((319.5 + 539 * local[0] / local[2], 239.5 + 539 * local[1] / local[2]))
    (ul, vl), (ur, vr) = pixels
    assert setup.vertical_px((ul, vl), ur) == pytest.approx(vl - vr, abs=1e-6)
    assert ul - ur >= setup.parallel_px((ul, vl)) - 1e-6


@settings(deadline=None, max_examples=150)
@given(st.integers(0, 5), st.integers(0, 5), st.integers(0, 2**32 - 1))
def test_the_pairing_is_the_best_of_all(rows, columns, seed):
    rng = np.random.default_rng(seed)
    costs = rng.uniform(0, 10, (rows, columns))
    costs[rng.random((rows, columns)) < 0.4] = math.inf
    chosen = optimal_assignment(costs)
    assert len({i for i, _ in chosen}) == len({j for _, j in chosen}) == len(chosen)
    best = (0, 0.0)
    for count in range(min(rows, columns), 0, -1):
        sums = [
            sum(costs[i, j] for i, j in zip(some, order, strict=True))
            for some in itertools.combinations(range(rows), count)
            for order in itertools.permutations(range(columns), count)
        ]
        finite = [s for s in sums if math.isfinite(s)]
        if finite:
            best = (count, min(finite))
            break
    assert len(chosen) == best[0]
    assert sum(costs[i, j] for i, j in chosen) == pytest.approx(best[1])


def test_corner_differences_both_ways():
    metric = corner_metric(Box((100, 50, 160, 110), 0.9, 0, "cube"), Box((88, 49, 150, 110), 0.8, 0, "cube"))
    np.testing.assert_allclose(metric.left_minus_right_px, [12, 1, 10, 0])
    np.testing.assert_allclose(metric.right_minus_left_px, [-12, -1, -10, 0])
    np.testing.assert_allclose(metric.center_px, [11, 0.5])
    assert metric.size_ratio == pytest.approx(62 / 60)


def test_a_cut_side_is_nan_and_the_others_stay():
    cut = Box((-0.5, 50, 60, 110), 0.9, 0, "cube", CUT_LEFT)
    metric = corner_metric(Box((20, 50, 80, 111), 0.9, 0, "cube"), cut)
    assert math.isnan(metric.left_minus_right_px[0])
    np.testing.assert_allclose(metric.left_minus_right_px[1:], [0, 20, 1])
    assert math.isnan(metric.center_px[0])
    assert metric.center_px[1] == pytest.approx(0.5)
    assert math.isnan(metric.size_ratio)
    assert metric.valid_sides == (False, True, True, True)


@pytest.mark.parametrize(
    ("disparity", "expected"),
    [(10.0, (False, False, True, False)), (30.0, (True, False, False, False)), (math.nan, (True, False, True, False))],
)
def test_the_side_that_disagrees_is_the_hidden_one(disparity, expected):
    whole, narrow = Box((100, 50, 160, 110), 0.9, 0, "c"), Box((90, 50, 130, 110), 0.9, 0, "c")
    # Left sides differ by 10, right ones by 30.
    assert hidden_sides(whole, narrow, 1.25, disparity, 0.0) == expected
    assert hidden_sides(whole, replace(narrow, xyxy_px=(90, 50, 145, 110)), 1.25, disparity, 0.0) == (False,) * 4


def test_gaze_geometry_of_a_fixated_point_has_no_disparity():
    eyes = gaze_for_point((0.5, 0.05, -0.1), 0.065)
    assert geometry(eyes).vertical_px((319.5, 239.5), 319.5) == pytest.approx(0.0, abs=1e-9)
