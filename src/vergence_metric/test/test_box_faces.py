"""Faces as targets: the point between the eyes, its distance, and landmarks through smoothing and messages."""

import math

import numpy as np
import pytest

from vergence_metric.boxes import BoxMeasurement
from vergence_metric.boxes.detections import FACE_LANDMARKS, Box
from vergence_metric.boxes.parameters import BoxMeasurementParameters, BoxMetricParameters, DetectorParameters
from vergence_metric.boxes.smoothing import LagLimitedFilter, smoothed_pair
from vergence_metric.boxes.target_point import locate
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
from vergence_rig.testing.ideal_eyes import gaze_for_point

RIG = default_rig()
HEAD = Kinematics(RIG)
CAMERAS = CameraModel(RIG.left_camera), CameraModel(RIG.right_camera)


def scene(x, y=1):
    """A red cell of 16 px at column `x` (px) and row `y` of cells, BGR: YuNet's face is about it."""
    image = np.zeros((96, 128, 3), np.uint8)
    image[16 * y : 16 * y + 16, x : x + 16, 2] = 255
    return image


def test_the_point_of_a_face_is_between_its_eyes():
    landmarks = ((30.0, 40.0), (70.0, 44.0), (50.0, 60.0), (35.0, 80.0), (66.0, 82.0))
    assert len(landmarks) == len(FACE_LANDMARKS)
    face = Box((10.0, 10.0, 90.0, 110.0), 0.9, 0, "face", landmarks_px=landmarks)
    assert face.point_px == (50.0, 42.0)
    assert Box((10.0, 10.0, 90.0, 110.0), 0.9, 0, "cube").point_px == (50.0, 60.0)


def test_directions_and_place_are_of_the_point_between_the_eyes(onnx_model):
    path = str(onnx_model("yunet"))
    measurement = BoxMeasurement(BoxMetricParameters(DetectorParameters(model=path)), HEAD)
    k = [100.0, 0, 63.5, 0, 100.0, 47.5, 0, 0, 1]
    camera = CameraModel.from_camera_info_values(128, 96, k, [])
    result = measurement.measure(scene(64), scene(48), 0.0, EyeAngles(0.0, 0.0, 0.0), (camera, camera))
    assert result.class_name == "face"
    # The built face has its eyes a fifth of a cell below the cell's top, its box's middle in the cell's.
    expected = math.atan((15.5 + 0.2 * 16 - 47.5) / 100)
    assert result.left_rad == pytest.approx((math.atan(0.08), expected), abs=1e-6)
    assert result.right_rad == pytest.approx((-math.atan(0.08), expected), abs=1e-6)
    assert result.point is not None
    x, _, z = result.point.point_m
    assert math.atan2(-z, x) == pytest.approx(expected, abs=1e-6)
    assert result.objects[0].tilt_rad == pytest.approx(expected, abs=1e-6)


def test_smoothing_moves_landmarks_as_it_moves_sides():
    def face(shift):
        return Box((shift, 0.0, 20.0 + shift, 30.0), 0.9, 0, "face", landmarks_px=((shift + 5.0, 10.0),) * 5)

    low_pass = LagLimitedFilter(0.1)
    smoothed_pair(low_pass, 0.0, face(0.0), face(-4.0))
    left, right = smoothed_pair(low_pass, 0.1, face(10.0), face(6.0))
    assert left.xyxy_px[0] == pytest.approx(5.0)
    assert left.landmarks_px[2] == pytest.approx((10.0, 10.0))
    assert right.landmarks_px[4] == pytest.approx((6.0, 10.0))
    plain = Box((0.0, 0.0, 20.0, 30.0), 0.9, 0, "cube")
    assert smoothed_pair(low_pass, 0.2, plain, plain) == (plain, plain)


@pytest.mark.parametrize("distance_m", [0.5, 0.8, 1.2, 2.0, 3.0])
def test_the_interval_holds_the_distance_of_a_person(distance_m):
    """With errors of pixels and joints as stated, 95 % of the intervals hold the distance, from 0.5 to 3 m."""
    rng = np.random.default_rng(round(10 * distance_m))
    direction_px, disparity_px, joint_rad = 1.0, 0.3, 0.004
    inside, unknown, rounds = 0, 0, 400
    for _ in range(rounds):
        point = distance_m * np.array([1.0, rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2)])
        true = gaze_for_point(point, RIG.baseline_m)
        pixels = []
        for left, pan, camera in zip((True, False), (true.pan_left_rad, true.pan_right_rad), CAMERAS, strict=True):
            ray = HEAD.rotation_rig_from_optical(pan, true.tilt_rad).T @ (point - HEAD.lens(left, pan, true.tilt_rad))
            pixels.append(camera.ray_to_pixel(ray[None])[0])
        pixels[1][0] -= rng.normal(0.0, disparity_px)
        reported = EyeAngles(
            *(np.array([true.pan_left_rad, true.pan_right_rad, true.tilt_rad]) + rng.normal(0.0, joint_rad, 3))
        )
        found = locate(
            tuple(pixels[0]), tuple(pixels[1]), CAMERAS, reported, HEAD, (direction_px, disparity_px, joint_rad)
        )
        if found is None:
            unknown += 1
            continue
        low, high = found.interval_m
        assert low < found.distance_m < high
        inside += low <= float(np.linalg.norm(point)) <= high
    assert unknown <= (0.02 if distance_m > 2.0 else 0.0) * rounds
    assert 0.92 <= inside / (rounds - unknown) <= 0.985


def test_of_the_far_end_nothing_is_known_where_the_joints_could_be_parallel():
    point = np.array([3.0, 0.0, 0.0])
    eyes = gaze_for_point(point, RIG.baseline_m)
    middle = ((RIG.left_camera.width_px - 1) / 2, (RIG.left_camera.height_px - 1) / 2)
    near, far = (locate(middle, middle, CAMERAS, eyes, HEAD, (1.0, 0.3, sigma)) for sigma in (0.001, 0.01))
    assert near is not None
    assert far is not None
    assert near.interval_m[1] < 4.0
    assert far.interval_m[1] == math.inf
    assert far.interval_m[0] < near.interval_m[0] < 3.0


def test_smoothing_can_be_switched_on_for_faces(onnx_model):
    parameters = BoxMetricParameters(
        DetectorParameters(model=str(onnx_model("yunet"))), measurement=BoxMeasurementParameters(smoothing_lag_s=0.2)
    )
    measurement = BoxMeasurement(parameters, HEAD)
    measurement.measure(scene(64), scene(48), 0.0)
    result = measurement.measure(scene(80), scene(64), 0.2)
    assert result.left is not None
    assert len(result.left.landmarks_px) == len(FACE_LANDMARKS)
    assert result.left.point_px[0] == pytest.approx(79.5, abs=0.1)
