"""Lenses and sensors."""

import cv2
import numpy as np
import pytest

from vergence_rig.camera import CameraModel
from vergence_rig.rig import CameraSpec
from vergence_sim.optics import Lens, Sensor
from vergence_sim.parameters import SimParameters

DISTORTION = (-0.04, 0.02, 0.0, 0.0, 0.0)


def test_a_lens_without_distortion_changes_nothing():
    lens = Lens(CameraSpec())
    view = np.random.default_rng(0).integers(0, 255, (480, 640, 3), dtype=np.uint8)
    assert lens.apply(view) is view
    assert lens.render_focal_px == 539.0
    assert lens.distorted((100.0, 50.0)) == (100.0, 50.0)


def test_a_rendered_point_lands_where_the_camera_model_says():
    camera = CameraSpec(distortion=DISTORTION)
    lens = Lens(camera)
    ray = np.array([[0.4, -0.3, 1.0]])
    centre = np.array([319.5, 239.5])
    rendered = ray[0, :2] * lens.render_focal_px + centre
    view = np.zeros((480, 640, 3), np.uint8)
    cv2.circle(view, tuple(int(v) for v in np.rint(rendered)), 6, (255, 255, 255), -1)
    image = lens.apply(view)[:, :, 0]
    rows, columns = np.nonzero(image > 127)
    found = np.array([columns.mean(), rows.mean()])
    drawn_off = np.rint(rendered) - rendered
    expected = CameraModel(camera).ray_to_pixel(ray)[0]
    assert found == pytest.approx(expected + drawn_off, abs=0.4)
    ideal = (319.5 + 539 * 0.4, 239.5 - 539 * 0.3)
    assert lens.distorted(ideal) == pytest.approx(expected, abs=1e-6)


def test_no_corner_is_left_without_a_view():
    lens = Lens(CameraSpec(distortion=DISTORTION))
    assert lens.apply(np.full((480, 640, 3), 200, np.uint8)).min() == 200


def test_noise_has_its_deviation_and_differs_from_frame_to_frame():
    sensor = Sensor(np.random.default_rng(0), (480, 640), right=False)
    grey = np.full((480, 640, 3), 128, np.uint8)
    parameters = SimParameters.ideal().replaced({"camera.noise_sigma": 4.0})
    first, second = sensor.apply(grey, parameters), sensor.apply(grey, parameters)
    assert first.astype(float).std() == pytest.approx(4.0, rel=0.03)
    assert not np.array_equal(first, second)


def test_exposure_and_white_balance_are_the_right_eyes_only():
    grey = np.full((48, 64, 3), 100, np.uint8)
    parameters = SimParameters.ideal().replaced(
        {"right_camera.gain": 1.2, "right_camera.blue_gain": 0.9, "right_camera.red_gain": 1.1}
    )
    right = Sensor(np.random.default_rng(0), (48, 64), right=True).apply(grey, parameters)
    left = Sensor(np.random.default_rng(0), (48, 64), right=False).apply(grey, parameters)
    assert right[0, 0].tolist() == [108, 120, 132]
    assert np.array_equal(left, grey)


def test_jpeg_leaves_its_marks():
    noisy = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    sensor = Sensor(np.random.default_rng(0), (48, 64), right=False)
    assert np.array_equal(sensor.apply(noisy, SimParameters.ideal()), noisy)
    compressed = SimParameters.ideal().replaced({"camera.jpeg_quality": 60})
    assert not np.array_equal(sensor.apply(noisy, compressed), noisy)
