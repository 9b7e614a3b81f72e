"""Metric II of whole pairs: statuses, refinement, smoothing, the target's place."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.boxes import BoxMeasurement, BoxStatus, DetectorError, draw, measure_pair
from vergence_metric.boxes.box_overlay import overlay_lines
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.parameters import BoxMetricParameters, DetectorParameters
from vergence_metric.boxes.refinement import refine
from vergence_metric.boxes.smoothing import LagLimitedFilter
from vergence_metric.boxes.target_point import locate
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, rotation_rig_from_optical
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
from vergence_rig.testing.ideal_eyes import gaze_for_point

CAMERAS = (CameraModel(default_rig().left_camera), CameraModel(default_rig().right_camera))
BASELINE_M = 0.065
HEAD = Kinematics(default_rig())


def scene(x, y=1, width=128, height=96, red=255):
    """A red cell of 16 px with a texture in the other channels, at column `x` (px) and row `y` of cells, BGR."""
    image = np.zeros((height, width, 3), np.uint8)
    image[16 * y : 16 * y + 16, x : x + 16, 2] = red
    return image


@pytest.fixture
def measurement(onnx_model):
    path = str(onnx_model("yolov6", classes=1, names='{"0": "cube"}'))
    return BoxMeasurement(BoxMetricParameters(DetectorParameters(model=path, threshold=0.5)), HEAD)


def test_a_pair_in_both_eyes(measurement):
    result = measurement.measure(scene(48), scene(32))
    assert result.status is BoxStatus.OK
    assert result.reason == ""
    np.testing.assert_allclose(result.corners.left_minus_right_px, [16, 0, 16, 0])
    np.testing.assert_allclose(result.corners.right_minus_left_px, [-16, 0, -16, 0])
    assert result.center_px == (16.0, 0.0)
    assert result.class_name == "cube"
    assert result.sigma_px > 0
    assert math.isnan(result.center_rad[0])  # no camera is known
    assert result.point is None


def test_one_eye_blind_and_both(measurement):
    nothing = np.zeros((96, 128, 3), np.uint8)
    only = measurement.measure(scene(48), nothing)
    assert only.status is BoxStatus.LEFT_ONLY
    assert only.left is not None
    assert only.right is None
    assert np.isnan(only.corners.left_minus_right_px).all()
    assert math.isnan(only.sigma_px)
    assert measurement.measure(nothing, scene(48), 10.0).status is BoxStatus.RIGHT_ONLY
    assert measurement.measure(nothing, nothing, 20.0).status is BoxStatus.NO_TARGET


def test_a_box_at_the_border_is_cut(measurement):
    result = measurement.measure(scene(16), scene(0))
    assert result.status is BoxStatus.CUT
    assert math.isnan(result.corners.left_minus_right_px[0])
    np.testing.assert_allclose(result.corners.left_minus_right_px[1:], [0, 16, 0])
    assert math.isnan(result.center_px[0])


def test_two_alike_are_ambiguous_until_the_past_decides(measurement):
    both = np.maximum(scene(16), scene(64))
    result = measurement.measure(scene(64), both)
    assert result.status is BoxStatus.AMBIGUOUS
    assert np.isnan(result.corners.left_minus_right_px).all()
    measurement.measure(scene(64), scene(64), 10.0)
    assert measurement.measure(scene(64), both, 10.1).status is BoxStatus.OK


def test_angles_and_place_with_cameras_and_joints(measurement):
    k = [100.0, 0, 63.5, 0, 100.0, 47.5, 0, 0, 1]
    cameras = tuple(CameraModel.from_camera_info_values(128, 96, k, []) for _ in range(2))
    result = measurement.measure(scene(64), scene(48), 0.0, EyeAngles(0.0, 0.0, 0.0), cameras)
    # Centres at columns 71.5 and 55.5: 8 px right and left of the axis.
    assert result.left_rad == pytest.approx((math.atan(0.08), math.atan((23.5 - 47.5) / 100)))
    assert result.right_rad[0] == pytest.approx(-math.atan(0.08))
    assert result.center_rad[0] == pytest.approx(2 * math.atan(0.08))
    assert result.point is not None
    assert result.point.point_m[0] == pytest.approx(0.065 * 100 / 16, rel=1e-6)
    assert result.point.point_m[1] == pytest.approx(0.0, abs=1e-9)


def test_measure_pair_is_one_call(onnx_model):
    path = onnx_model("yolov6", classes=1)
    result = measure_pair(scene(48), scene(32), path, BoxMetricParameters(DetectorParameters(threshold=0.5)))
    assert result.center_px[0] == 16.0
    with pytest.raises(DetectorError, match="right image"):
        measure_pair(scene(48), scene(32, width=160), path)


def test_the_picture_has_both_eyes_and_the_figures(measurement):
    left, right = scene(48), scene(32)
    result = measurement.measure(left, right)
    picture = draw(left, right, result)
    assert picture.shape == (96, 256, 3)
    assert (picture != np.hstack([left, right])).any()
    assert left.max(axis=(0, 1)).tolist() == [0, 0, 255]  # the images themselves are not drawn on
    assert overlay_lines(result)[1] == "top left: +16.0 +0.0 >  -16.0 +0.0 <".replace("+0.0 <", f"{-0.0:+.1f} <")
    blind = measurement.measure(np.zeros_like(left), np.zeros_like(right), 99.0)
    assert "neither eye" in overlay_lines(blind)[0]


def textured(seed, height=240, width=320):
    rng = np.random.default_rng(seed)
    image = cv2.GaussianBlur(rng.uniform(0, 255, (height, width)).astype(np.float32), (0, 0), 1.6)
    return (image - image.mean()) / image.std() * 45 + 120


def shifted(image, disparity_of):
    """The right view of a left one whose pixels have disparities `disparity_of(x, y)` (x_left - x_right)."""
    y, x = np.mgrid[0 : image.shape[0], 0 : image.shape[1]].astype(np.float32)
    # The right image at x shows what the left one has at x + d.
    seen = cv2.remap(image.astype(np.float32), x + disparity_of(x, y).astype(np.float32), y, cv2.INTER_CUBIC)
    return np.clip(seen, 0, 255).astype(np.uint8)


# Multiples of 1/32, to which an older OpenCV rounds when it draws.
@pytest.mark.parametrize("disparity", [0.0, 7.3125, -11.59375])
def test_refinement_of_a_flat_thing_is_sub_pixel(disparity):
    left = textured(1)
    right = shifted(left, lambda x, y: np.full_like(x, disparity))
    target = Box((120, 80, 200, 160), 0.9, 0, "c")
    # The boxes are a few pixels off, as a detector's are.
    other = Box((122 - disparity, 80, 203 - disparity, 159), 0.9, 0, "c")
    found = refine(np.clip(left, 0, 255).astype(np.uint8), right, target, other)
    assert found.horizontal_px == pytest.approx(disparity, abs=0.05)
    assert found.vertical_px == pytest.approx(0.0, abs=0.05)
    assert found.confidence > 0.8
    assert found.sigma_px < 0.2


def test_refinement_of_a_slanted_thing_is_its_mean():
    left = textured(2)
    right = shifted(left, lambda x, y: 6.0 + 0.06 * (x - 155.0))
    box = Box((115, 75, 195, 155), 0.9, 0, "c")
    found = refine(np.clip(left, 0, 255).astype(np.uint8), right, box, Box((109, 75, 189, 155), 0.9, 0, "c"))
    # The left box's centre, 155, is seen at x = 155 - d with d = 6 + 0.06 (x - 155).
    assert found.horizontal_px == pytest.approx(6.0 / 1.06, abs=0.05)


def test_refinement_follows_a_face_that_one_eye_sees_much_narrower():
    left = textured(5)
    # In the right image a front face up to x = 160, beyond it a side face of which the left eye sees a half.
    right = shifted(left, lambda x, y: np.where(x < 160, 4.0, 4.0 - 0.5 * (x - 160)))
    found = refine(
        np.clip(left, 0, 255).astype(np.uint8),
        right,
        Box((104, 80, 174, 160), 0.9, 0, "c"),
        Box((100, 80, 180, 160), 0.9, 0, "c"),
    )
    # Both images' pixels count: the right one's 60 and 20 columns, the left one's 60 and 10.
    values = [*np.full(60, 4.0), *(4.0 - 0.5 * np.arange(0.5, 20)), *np.full(60, 4.0), *(4.0 - np.arange(0.5, 10))]
    assert found.horizontal_px == pytest.approx(np.mean(values), abs=0.15)


def test_refinement_counts_a_side_face_that_one_eye_sees_too_narrow_to_match():
    left = textured(8)
    # As above, but the left eye sees a fifth of it: 24 columns of the right image are 4.8 of the left one.
    right = shifted(left, lambda x, y: np.where(x < 160, 4.0, 4.0 - 0.8 * (x - 160)))
    found = refine(
        np.clip(left, 0, 255).astype(np.uint8),
        right,
        Box((104, 80, 168.8, 160), 0.9, 0, "c"),
        Box((100, 80, 184, 160), 0.9, 0, "c"),
    )
    side_px = 4.0 - 0.8 * 12
    assert found.horizontal_px == pytest.approx((120 * 4.0 + 28.8 * side_px) / 148.8, abs=0.5)


def test_refinement_adds_no_side_face_where_the_other_eye_sees_none():
    left = textured(9)
    # The right eye sees 20 columns more at the side, the left one none of them: its box ends where the face begins.
    right = shifted(left, lambda x, y: np.where(x < 160, 4.0, 4.0 - (x - 160)))
    found = refine(
        np.clip(left, 0, 255).astype(np.uint8),
        right,
        Box((104, 80, 164, 160), 0.9, 0, "c"),
        Box((100, 80, 180, 160), 0.9, 0, "c"),
    )
    assert found.horizontal_px == pytest.approx(4.0, abs=0.25)


def test_refinement_leaves_the_background_out():
    left = textured(6)
    # A disc of disparity 12 before a wall of -8, in boxes whose corners show the wall.
    right = shifted(left, lambda x, y: np.where((x - 148) ** 2 + (y - 120) ** 2 < 40**2, 12.0, -8.0))
    found = refine(
        np.clip(left, 0, 255).astype(np.uint8),
        right,
        Box((120, 80, 200, 160), 0.9, 0, "c"),
        Box((108, 80, 188, 160), 0.9, 0, "c"),
    )
    assert found.horizontal_px == pytest.approx(12.0, abs=0.1)
    assert 0.6 < found.confidence < 0.95


@settings(deadline=None, max_examples=15)
@given(st.integers(-20, 20), st.integers(-5, 5))
def test_refinement_of_a_moved_picture_moves_with_it(across, down):
    left = np.clip(textured(7), 0, 255).astype(np.uint8)
    right = shifted(textured(7), lambda x, y: 3.3 + 0.03 * (x - 160))
    moved = np.roll(right, (-down, -across), (0, 1))
    box, other = Box((120, 80, 200, 160), 0.9, 0, "c"), Box((116, 80, 196, 160), 0.9, 0, "c")
    shifted_box = Box((116 - across, 80 - down, 196 - across, 160 - down), 0.9, 0, "c")
    still, after = refine(left, right, box, other), refine(left, moved, box, shifted_box)
    assert after.horizontal_px - still.horizontal_px == pytest.approx(across, abs=1e-3)
    assert after.vertical_px - still.vertical_px == pytest.approx(down, abs=1e-3)


def test_refinement_says_why_not():
    left, box = np.clip(textured(3), 0, 255).astype(np.uint8), Box((120, 80, 200, 160), 0.9, 0, "c")
    other = np.clip(textured(4), 0, 255).astype(np.uint8)
    assert math.isnan(refine(left, other, box, box).horizontal_px)
    assert refine(left, other, box, box).reason
    flat = np.full_like(left, 80)
    assert math.isnan(refine(flat, flat, box, box).horizontal_px)
    tiny = Box((120, 80, 125, 85), 0.9, 0, "c")
    assert "smaller than" in refine(left, left, tiny, tiny).reason


@settings(deadline=None, max_examples=50)
@given(st.floats(0.02, 0.5), st.floats(0.01, 0.2), st.floats(-300, 300))
def test_smoothing_lags_a_ramp_by_what_it_says(lag_s, period_s, speed):
    smooth = LagLimitedFilter(lag_s)
    steps = math.ceil(12 * (lag_s + period_s) / period_s)
    for i in range(steps):
        value = smooth.update(i * period_s, np.array([speed * i * period_s]))
    behind = speed * (steps - 1) * period_s - value[0]
    assert behind == pytest.approx(speed * lag_s, rel=1e-3, abs=1e-6)


def test_smoothing_begins_anew_after_a_reset_and_a_jump_back():
    smooth = LagLimitedFilter(0.3)
    smooth.update(1.0, np.array([0.0]))
    assert smooth.update(1.1, np.array([10.0]))[0] < 5
    assert smooth.update(0.5, np.array([10.0]))[0] == 10.0
    smooth.reset()
    assert smooth.update(0.6, np.array([3.0]))[0] == 3.0


@settings(deadline=None, max_examples=40)
@given(st.floats(0.25, 2.0), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.1, 0.1))
def test_a_point_is_found_where_it_is(x, y, z, off):
    point = np.array([x, x * y, x * z])
    true = gaze_for_point(point, BASELINE_M)
    eyes = EyeAngles(true.pan_left_rad + off, true.pan_right_rad + off / 2, true.tilt_rad - off / 3)
    pixels = []
    for pan, side in ((eyes.pan_left_rad, 1), (eyes.pan_right_rad, -1)):
        local = rotation_rig_from_optical(pan, eyes.tilt_rad).T @ (point - [0, side * BASELINE_M / 2, 0])
        pixels.append(tuple(CAMERAS[0].ray_to_pixel(local[None])[0]))
    found = locate(pixels[0], pixels[1], CAMERAS, eyes, HEAD, (1.0, 0.5, 0.002))
    assert found is not None
    np.testing.assert_allclose(found.point_m, point, atol=1e-6)
    assert (np.linalg.eigvalsh(found.covariance_m2) > 0).all()


def test_covariance_is_what_repeated_noise_gives():
    point = np.array([0.6, 0.05, -0.02])
    eyes = gaze_for_point(point, BASELINE_M)
    center = (319.5, 239.5)
    sigmas = (0.8, 0.4, 0.001)
    found = locate(center, center, CAMERAS, eyes, HEAD, sigmas)
    assert found is not None
    rng = np.random.default_rng(5)
    samples = []
    for _ in range(4000):
        u, v = rng.normal(0, sigmas[0], 2)
        d, joints = rng.normal(0, sigmas[1]), rng.normal(0, sigmas[2], 3)
        moved = EyeAngles(eyes.pan_left_rad + joints[0], eyes.pan_right_rad + joints[1], eyes.tilt_rad + joints[2])
        left, right = (center[0] + u, center[1] + v), (center[0] + u - d, center[1] + v)
        sample = locate(left, right, CAMERAS, moved, HEAD, (1e-3, 1e-3, 1e-6))
        assert sample is not None
        samples.append(sample.point_m)
    spread = np.cov(np.array(samples).T)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance_m2)), np.sqrt(np.diag(spread)), rtol=0.08)


def test_a_point_behind_the_eyes_is_none():
    assert locate((300, 240), (340, 240), CAMERAS, EyeAngles(0.0, 0.0, 0.0), HEAD, (1, 1, 0.001)) is None
