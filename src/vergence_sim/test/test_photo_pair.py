"""A pair of photographs: its camera, its points, and what cannot serve as one."""

import math

import cv2
import numpy as np
import pytest

from vergence_rig.rig import JOINT_NAMES, CameraSpec
from vergence_rig.testing.ideal_eyes import gaze_for_point
from vergence_sim.photo.pair import PhotoError, PhotoPair, PhotoPoint, read_pair

GREY = np.full((240, 320, 3), 90, np.uint8)


def test_a_focal_length_and_a_centre_are_assumed_where_none_are_given():
    pair = PhotoPair(GREY, GREY)
    assert (pair.fx_px, pair.cx_px, pair.cy_px) == (272.0, 159.5, 119.5)
    given = PhotoPair(GREY, GREY, 300.0, 150.0, 110.0)
    assert given.matrix.tolist() == [[300.0, 0.0, 150.0], [0.0, 300.0, 110.0], [0.0, 0.0, 1.0]]


def test_the_fixation_of_a_point_is_that_of_its_place_in_space():
    baseline_m, place = 0.065, np.array([0.8, 0.1, -0.15])
    pair = PhotoPair(GREY, GREY, 300.0)
    x, y = (300.0 * -(place[1] - baseline_m / 2) / place[0] + 159.5, 300.0 * -place[2] / place[0] + 119.5)
    found = pair.fixation(PhotoPoint(x, y, 300.0 * baseline_m / place[0]))
    wanted = gaze_for_point(place, baseline_m)
    assert found.as_dict() == pytest.approx(wanted.as_dict(), abs=1e-12)
    assert found.vergence_rad > 0
    assert found.tilt_rad > 0


def test_what_lies_on_the_axes_is_what_is_fixated():
    pair, point = PhotoPair(GREY, GREY, 300.0), PhotoPoint(250.0, 40.0, 33.0)
    left, right = pair.on_axes(pair.fixation(point))
    assert left == pytest.approx((250.0, 40.0))
    assert right == pytest.approx((217.0, 40.0))


def test_without_a_disparity_only_the_left_eye_and_the_tilt_are_known():
    pair, point = PhotoPair(GREY, GREY), PhotoPoint(250.0, 40.0)
    known, unknown = pair.fixation(PhotoPoint(250.0, 40.0, 33.0)), pair.fixation(point)
    assert not point.depth_known
    assert (unknown.pan_left_rad, unknown.tilt_rad) == (known.pan_left_rad, known.tilt_rad)
    assert math.isnan(unknown.pan_right_rad)
    pair.check(point)
    with pytest.raises(PhotoError, match="a point must lie inside both photographs"):
        pair.check(PhotoPoint(-1, 5))


def test_the_start_is_straight_ahead_or_shows_the_point():
    pair, camera = PhotoPair(GREY, GREY, 150.0), CameraSpec(width_px=240, height_px=160, fx_px=300.0, fy_px=300.0)
    assert pair.start_towards(PhotoPoint(160.0, 120.0, 5.0), camera, 20.0).as_dict() == dict.fromkeys(JOINT_NAMES, 0.0)
    for point in (PhotoPoint(20.0, 10.0), PhotoPoint(300.0, 230.0, 60.0)):
        start, wanted = pair.start_towards(point, camera, 20.0), pair.fixation(point)
        assert start.vergence_rad == 0.0
        assert abs(wanted.pan_left_rad - start.pan_left_rad) <= math.atan(100 / 300) + 1e-12
        assert abs(wanted.tilt_rad - start.tilt_rad) <= math.atan(60 / 300) + 1e-12
        if point.depth_known:
            assert abs(wanted.pan_right_rad - start.pan_right_rad) <= math.atan(100 / 300) + 1e-12


@pytest.mark.parametrize(
    "point", [PhotoPoint(-1, 5, 0), PhotoPoint(5, 240, 0), PhotoPoint(5, 5, 6), PhotoPoint(5, 5, -320)]
)
def test_a_point_outside_either_photograph_is_refused(point):
    pair = PhotoPair(GREY, GREY)
    pair.check(PhotoPoint(5, 5, 5))
    with pytest.raises(PhotoError, match="a point must lie inside both photographs of 320x240 px: got x"):
        pair.check(point)


def test_photographs_of_two_sizes_are_no_pair():
    with pytest.raises(PhotoError, match="must have one size: left is 320x240, right is 320x200 px"):
        PhotoPair(GREY, GREY[:200])
    with pytest.raises(PhotoError, match=r"right photograph must be \(h, w, 3\) uint8: got \(240, 320\)"):
        PhotoPair(GREY, GREY[:, :, 0])


def test_files_are_read_and_those_that_cannot_be_are_named(tmp_path):
    path, broken = tmp_path / "a.png", tmp_path / "b.png"
    cv2.imwrite(str(path), GREY)
    broken.write_bytes(b"not a picture")
    assert np.array_equal(read_pair(path, path).left, GREY)
    with pytest.raises(PhotoError, match=r"the right photograph '.*b.png' is not a picture"):
        read_pair(path, broken)
    with pytest.raises(PhotoError, match=r"the left photograph '.*c.png' cannot be read: No such file"):
        read_pair(tmp_path / "c.png", path)
    with pytest.raises(PhotoError, match="set the parameter 'right' to the path of a picture"):
        read_pair(path, "")
    broken.write_bytes(b"")
    with pytest.raises(PhotoError, match="is not a picture"):
        read_pair(broken, path)


def test_tilt_is_one_for_both_eyes():
    pair = PhotoPair(GREY, GREY)
    left, right = pair.rays(PhotoPoint(300, 20, 40))
    assert math.atan2(-left[2], left[0]) == math.atan2(-right[2], right[0])
