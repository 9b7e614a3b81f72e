"""Ideal images of pairs: the principal point in the middle, rows level, windows cut where a camera saw nothing."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from vergence_metric.edges.windows import centre_windows
from vergence_metric.measurement.edge_metric import EdgeMetric
from vergence_metric.pairs.ideal_images import IdealImages
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import EyeMount, Rig, default_rig

RIG = replace(
    default_rig(),
    left_camera=default_rig().left_camera.replaced(cx_px=345.0, cy_px=200.0, fx_px=520.0, fy_px=522.0),
    right_camera=default_rig().right_camera.replaced(cx_px=300.0, cy_px=270.0, distortion=(-0.05, 0.02, 0.0, 0.0, 0.0)),
    left_mount=EyeMount(roll_rad=0.03, pitch_rad=0.02),
    right_mount=EyeMount(roll_rad=-0.025, pitch_rad=-0.01),
)


def cameras(rig: Rig = RIG) -> tuple[CameraModel, CameraModel]:
    return CameraModel(rig.left_camera), CameraModel(rig.right_camera)


def views(points: np.ndarray) -> list[np.ndarray]:
    """Both cameras' images of bright dots at infinitely far directions (N, 3), eyes straight ahead."""
    k, images = Kinematics(RIG), []
    for left, camera in zip((True, False), cameras(), strict=True):
        image = np.full((480, 640), 30, np.uint8)
        for x, y in camera.ray_to_pixel(points @ k.rotation_rig_from_camera(left, 0.0, 0.0)):
            cv2.circle(image, (round(16 * x), round(16 * y)), 16 * 4, 220, -1, cv2.LINE_AA, 4)
        images.append(image)
    return images


def spots(image: np.ndarray) -> np.ndarray:
    _, _, _, centres = cv2.connectedComponentsWithStats((image > 125).astype(np.uint8))
    return centres[1:][np.lexsort((centres[1:, 0], centres[1:, 1].round(-1)))]


def test_far_things_lie_at_the_same_pixels_of_both_eyes() -> None:
    directions = np.array([(1.0, y, z) for y in (-0.3, 0.0, 0.25) for z in (-0.2, 0.0, 0.2)])
    ideal = IdealImages(RIG)
    images = ideal.set_cameras(cameras())
    left, right = (spots(image) for image in ideal.draw(*views(directions)))
    assert left.shape == right.shape == (9, 2)
    assert np.abs(left - right).max() < 0.6
    # straight ahead is in the middle of both, but for the pitch that both cameras share
    ahead = np.hypot(*(left - (319.5, 239.5)).T).min()
    assert ahead == pytest.approx(images[0].fx_px * np.tan(RIG.mean_pitch_rad), abs=0.6)


def test_equal_square_cameras_images_are_not_touched() -> None:
    ideal = IdealImages(default_rig())
    ideal.set_cameras(cameras(default_rig()))
    image = np.zeros((480, 640, 3), np.uint8)
    left, right = ideal.draw(image, image)
    assert left is image
    assert right is image
    assert ideal.seen_px is None


def test_windows_are_cut_where_a_camera_saw_nothing() -> None:
    ideal = IdealImages(RIG)
    images = ideal.set_cameras(cameras())
    seen_px = ideal.seen_px
    assert seen_px is not None
    inside = centre_windows((seen_px, seen_px + 2), 480, 640)
    for window, expected in zip(inside, (True, False), strict=True):
        rows, columns = np.mgrid[window.top : window.bottom, window.left : window.right]
        pixels = np.column_stack([columns.ravel(), rows.ravel()])
        taken = [image.to_camera(pixels) for image in images]
        assert all((at >= 0).all() and (at <= (639, 479)).all() for at in taken) == expected
    metric = EdgeMetric().measure(*ideal.draw(*views(np.array([(1.0, 0.0, 0.0)]))), seen_px)
    assert [window.clipped for window in metric.windows] == [size > seen_px for size in metric.windows_px]


def test_an_eye_without_calibration_has_the_rigs_camera_for_images_of_its_shape() -> None:
    ideal, pixels = IdealImages(default_rig()), np.zeros((240, 320), np.uint8)
    left, right = ideal.cameras((None, None), (pixels, pixels))
    assert (left.width_px, left.fx_px) == (320, 0.5 * 539.0)
    assert right.cx_px == pytest.approx(159.5)
    with pytest.raises(ValueError, match="no calibration of the left camera for 320x200 images"):
        ideal.cameras((None, None), (pixels[:200], pixels[:200]))
