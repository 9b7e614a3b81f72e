"""Features matched between views and joined to tracks, and the poses that the head looks from."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vergence_calibration.geometry.features import Features, features, matches, neighbours, tracks
from vergence_calibration.geometry.poses import PoseParameters, planned_poses, visited
from vergence_calibration.identification.axis_log import IdentifyError
from vergence_rig.rig import JOINT_NAMES, Joints, JointSpec, Rig, default_rig
from vergence_rig.servo import IDEAL, SG90

DEG = math.pi / 180


def cluttered(seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    picture = np.full((480, 640), 120, np.uint8)
    for _ in range(400):
        x, y, w, h = (int(value) for value in (*random.integers(0, 640, 2), *random.integers(5, 40, 2)))
        cv2.rectangle(picture, (x, y), (x + w, y + h), int(random.integers(20, 235)), -1)
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), 1.2))


def test_matches_of_a_turned_view_lie_where_it_was_turned_to() -> None:
    picture = cluttered(0)
    turn = np.array([[0.98, -0.05, 30.0], [0.04, 1.01, -12.0], [1e-5, 2e-5, 1.0]])
    first, second = features(picture), features(cv2.warpPerspective(picture, turn, (640, 480)))
    found = matches(first, second)
    assert len(found) > 150
    there = cv2.perspectiveTransform(first.pixels[found[:, 0]][None], turn)[0]
    off = second.pixels[found[:, 1]] - there
    assert np.median(np.hypot(*off.T)) < 0.25
    assert np.abs(np.median(off, axis=0)).max() < 0.05


def test_features_stand_where_the_image_has_them() -> None:
    # Turned upside down, a feature that is placed too far right is placed too far left.
    picture = cluttered(1)
    upright, turned = features(picture), features(np.ascontiguousarray(picture[::-1, ::-1]))
    back = (639.0, 479.0) - turned.pixels
    distance = np.linalg.norm(upright.pixels[:, None] - back[None], axis=2)
    nearest = distance.argmin(axis=1)
    near = distance[np.arange(len(nearest)), nearest] < 1.0
    assert near.sum() > 150
    assert np.abs(np.median(upright.pixels[near] - back[nearest[near]], axis=0)).max() < 0.05


def test_unrelated_views_do_not_match() -> None:
    assert len(matches(features(cluttered(2)), features(cluttered(3)))) == 0


def test_blank_views_have_no_features() -> None:
    blank = features(np.full((480, 640), 90, np.uint8))
    assert blank.pixels.shape == (0, 2)
    assert len(matches(blank, features(cluttered(0)))) == 0


def numbered(view: int, count: int) -> Features:
    return Features(
        np.column_stack([np.full(count, float(view)), np.arange(count, dtype=float)]),
        np.zeros((count, 128), np.float32),
    )


def test_tracks_join_matches_and_leave_out_what_is_ambiguous() -> None:
    found = [numbered(view, 4) for view in range(4)]
    pairs = [
        (0, 1, np.array([[0, 1], [1, 2], [3, 3]])),
        (1, 2, np.array([[1, 0], [2, 1], [3, 3]])),
        (2, 3, np.array([[0, 2]])),
        (0, 2, np.array([[0, 0], [1, 2]])),  # feature 1 of view 0 is joined to two features of view 2
    ]
    seen = tracks(found, pairs)
    sightings = {(int(p), int(v), float(y)) for p, v, (_, y) in zip(seen.point, seen.view, seen.pixels, strict=True)}
    assert sightings == {(0, 0, 0), (0, 1, 1), (0, 2, 0), (0, 3, 2), (1, 0, 3), (1, 1, 3), (1, 2, 3)}
    assert len(tracks(found, []).view) == 0


def test_views_are_paired_with_those_that_look_the_same_way() -> None:
    angles = np.array([0.0, 0.1, 0.2, 1.0, 1.1])
    axes = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(5)])
    assert neighbours(axes, 1) == [(0, 1), (1, 2), (3, 4)]
    assert set(neighbours(axes, 2)) == {(0, 1), (0, 2), (1, 2), (2, 3), (2, 4), (3, 4)}


# ---- poses


def head(pans: tuple[float, float, float, float], tilts: tuple[float, float], least: float, zero: float) -> Rig:
    base = default_rig()

    def joint(spec: JointSpec, low: float, high: float) -> JointSpec:
        return replace(spec, lower_rad=low, upper_rad=high, zero_rad=zero)

    joints = Joints(
        joint(base.pan_left, pans[0], pans[1]), joint(base.pan_right, pans[2], pans[3]), joint(base.tilt, *tilts)
    )
    return replace(base, joints=joints, minimum_vergence_rad=least)


@settings(deadline=None, max_examples=150, derandomize=True)
@given(
    ends=st.tuples(*(st.floats(0.15, 1.2) for _ in range(6))),
    least=st.floats(0.0, 0.1),
    zero=st.floats(-0.08, 0.08),
)
def test_poses_keep_to_the_limits_and_never_diverge(
    ends: tuple[float, float, float, float, float, float], least: float, zero: float
) -> None:
    rig = head((-ends[0], ends[1], -ends[2], ends[3]), (-ends[4], ends[5]), least, zero)
    try:
        planned = planned_poses(rig, PoseParameters())
    except IdentifyError:
        assume(False)
    assert len(planned) == PoseParameters().poses + 1
    for pose in planned:
        for name, joint in rig.joints.items():
            assert joint.lower_rad <= pose[name] <= joint.upper_rad
        left, right, _ = rig.eye_angles([pose[name] for name in JOINT_NAMES])
        assert right - left >= least - 1e-9
        assert right - left <= least + 18.1 * DEG + max(0.0, -ends[2] - ends[1])


def test_limits_too_close_are_named() -> None:
    with pytest.raises(IdentifyError, match=r"must leave a tilt of 10 degrees for the geometry: got 4\.7"):
        planned_poses(head((-1, 1, -1, 1), (-0.05, 0.05), 0.0, 0.0), PoseParameters())
    with pytest.raises(IdentifyError, match=r"version \(the pans together\)"):
        planned_poses(head((-0.1, 0.1, -0.1, 0.1), (-0.5, 0.5), 0.0, 0.0), PoseParameters())


def test_each_joint_arrives_from_both_sides_at_much_the_same_angles() -> None:
    rig = default_rig()
    planned = planned_poses(rig, PoseParameters())
    joints = np.array([[pose[name] for name in JOINT_NAMES] for pose in planned])
    poses = visited(rig, joints[1:].tolist(), joints[0].tolist())
    assert (poses.arrived != 0).all()
    for joint in range(3):
        assert abs(np.mean(poses.arrived[:, joint])) < 0.15
        assert abs(np.corrcoef(poses.joints_rad[:, joint], poses.arrived[:, joint])[0, 1]) < 0.5


def test_moves_within_the_play_do_not_say_where_a_joint_came_from() -> None:
    rig = default_rig().with_servos(SG90)
    poses = visited(rig, [[0.0, 0.0, 0.0], [0.1, 0.001, 0.0], [0.099, 0.002, 0.1], [0.2, -0.1, 0.101]], [0.0, 0.0, 0.0])
    assert poses.arrived.tolist() == [[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, -1, 1]]
    ideal = visited(rig.with_servos(IDEAL), [[0.001, 0.0, 0.0]], [0.0, 0.0, 0.0])
    assert ideal.arrived.tolist() == [[1, 0, 0]]
