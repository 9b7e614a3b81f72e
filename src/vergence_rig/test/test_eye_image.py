"""Ideal images: what both eyes look at is in the middle of both, level, at one focal length."""

from dataclasses import replace

import numpy as np
import pytest

from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import eye_images
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import CameraSpec, EyeMount, Rig, default_rig

_LEFT = CameraSpec(640, 480, 531.0, 533.0, 344.0, 221.0, (0.05, -0.1, 0.001, -0.001, 0.02))
_RIGHT = CameraSpec(800, 600, 690.0, 688.0, 380.0, 320.0)


def _rig() -> Rig:
    return replace(
        default_rig(),
        left_camera=_LEFT,
        right_camera=_RIGHT,
        left_mount=EyeMount(lens_x_m=0.022, lens_y_m=0.002, roll_rad=0.03, pitch_rad=0.02, yaw_rad=0.02),
        right_mount=EyeMount(lens_x_m=0.024, lens_y_m=-0.003, roll_rad=-0.02, pitch_rad=-0.03, yaw_rad=-0.04),
        tilt_axis_z_m=-0.045,
    )


def test_a_point_at_both_foveas_is_in_the_middle_of_both_ideal_images() -> None:
    rig, point = _rig(), np.array([0.6, 0.1, -0.15])
    k = Kinematics(rig)
    eyes = k.gaze_for_point(point)
    images = eye_images(rig, (CameraModel(_LEFT), CameraModel(_RIGHT)))
    for image, left, pan in zip(images, (True, False), (eyes.pan_left_rad, eyes.pan_right_rad), strict=True):
        turn = k.rotation_rig_from_camera(left, pan, eyes.tilt_rad)
        pixel = image.camera.ray_to_pixel((point - k.lens(left, pan, eyes.tilt_rad)) @ turn)
        assert image.to_ideal(pixel)[0, 0] == pytest.approx(319.5, abs=1e-4)
        assert image.to_ideal(pixel)[0, 1] == pytest.approx(239.5, abs=0.05)  # the lenses are not equally far forward
        assert image.to_camera(image.to_ideal(pixel)) == pytest.approx(pixel, abs=1e-6)


def test_ideal_images_have_the_smaller_cameras_size_and_its_focal_length() -> None:
    left, right = eye_images(_rig(), (CameraModel(_LEFT), CameraModel(_RIGHT)))
    assert left.ideal.equals(right.ideal)
    assert (left.ideal.width_px, left.ideal.height_px) == (640, 480)
    assert left.ideal.fx_px == pytest.approx(np.sqrt(531.0 * 533.0))
    x, y = left.maps()
    assert x.shape == y.shape == (480, 640)
    assert x.dtype == np.float32
    assert left.to_camera([(100.0, 50.0)])[0] == pytest.approx((x[50, 100], y[50, 100]), abs=1e-3)


def test_equal_cameras_without_distortion_are_left_as_they_are() -> None:
    rig = default_rig()
    camera = CameraModel(rig.left_camera)
    assert all(image.is_same for image in eye_images(rig, (camera, camera)))
    shifted = CameraModel(replace(rig.left_camera, cx_px=325.5))
    left, right = eye_images(rig, (shifted, camera))
    assert not left.is_same
    assert right.is_same
    assert left.to_ideal([(325.5, 239.5)])[0] == pytest.approx((319.5, 239.5))


def test_one_pixel_is_undistorted_as_many_are() -> None:
    rig = _rig()
    aside = replace(rig, left_mount=replace(rig.left_mount, yaw_rad=0.45, pitch_rad=0.45))
    for head in (rig, aside, default_rig()):
        for image in eye_images(head, (CameraModel(head.left_camera), CameraModel(head.right_camera))):
            for pixel in ((0.0, 0.0), (320.0, 240.0), (639.0, 12.5), (-5000.0, 5000.0)):
                assert image.undistorted(*pixel) == pytest.approx(tuple(image.undistort([pixel])[0]), nan_ok=True)
