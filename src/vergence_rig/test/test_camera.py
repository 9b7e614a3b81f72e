"""The camera model: golden pixels, round trips through distortion, OpenCV as the peer."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.camera import CameraModel, CameraModelError
from vergence_rig.rig import CameraSpec

PLAIN = CameraModel(CameraSpec())
BENT = CameraModel(CameraSpec(distortion=(-0.28, 0.09, 0.001, -0.0007, -0.01)))
K = [539.0, 0, 319.5, 0, 539.0, 239.5, 0, 0, 1]
RATIONAL = CameraModel.from_camera_info_values(
    640, 480, K, [0.3, -0.2, 0.001, 0.0005, 0.05, 0.6, -0.1, 0.02], "rational_polynomial"
)
FISHEYE = CameraModel.from_camera_info_values(640, 480, K, [-0.02, 0.01, -0.004, 0.001], "equidistant")


def test_golden_pixels() -> None:
    np.testing.assert_allclose(PLAIN.pixel_to_ray([[319.5, 239.5]]), [[0, 0, 1]])
    np.testing.assert_allclose(PLAIN.angles([[319.5 + 539, 239.5 - 539]]), [[np.pi / 4, -np.pi / 4]])
    np.testing.assert_allclose(PLAIN.ray_to_pixel([[0.1, -0.2, 1.0]]), [[319.5 + 53.9, 239.5 - 107.8]])


@pytest.mark.parametrize("model", [PLAIN, BENT, RATIONAL, FISHEYE], ids=["plain", "bent", "rational", "fisheye"])
@given(st.floats(0, 639), st.floats(0, 479))
@settings(deadline=None, max_examples=60)
def test_pixel_to_ray_to_pixel(model: CameraModel, u: float, v: float) -> None:
    rays = model.pixel_to_ray([[u, v]])
    assert np.linalg.norm(rays) == pytest.approx(1)
    np.testing.assert_allclose(model.ray_to_pixel(rays), [[u, v]], atol=1e-5)


@pytest.mark.parametrize("model", [BENT, RATIONAL], ids=["bent", "rational"])
def test_agrees_with_opencv(model: CameraModel) -> None:
    points = np.random.default_rng(0).uniform((-0.5, -0.4, 1), (0.5, 0.4, 1), (50, 3))
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.reshape(K, (3, 3)), model.distortion)
    np.testing.assert_allclose(model.ray_to_pixel(points), expected.reshape(-1, 2), atol=1e-8)


def test_agrees_with_opencv_fisheye() -> None:
    points = np.random.default_rng(0).uniform((-0.5, -0.4, 1), (0.5, 0.4, 1), (50, 3))
    expected, _ = cv2.fisheye.projectPoints(
        points[:, None], np.zeros(3), np.zeros(3), np.reshape(K, (3, 3)), FISHEYE.distortion
    )
    np.testing.assert_allclose(FISHEYE.ray_to_pixel(points), expected.reshape(-1, 2), atol=1e-8)


def test_points_behind_and_folded_back_have_no_pixel() -> None:
    assert np.isnan(PLAIN.ray_to_pixel([[0, 0, -1], [1, 0, 0]])).all()
    assert np.isnan(BENT.ray_to_pixel([[2.5, 0, 1]])).all()


def test_contains_is_the_image_to_its_outer_edges() -> None:
    inside = PLAIN.contains([[-0.5, -0.5], [639.5, 479.5], [640, 0], [0, -1], [np.nan, 0]])
    assert inside.tolist() == [True, True, False, False, False]


@pytest.mark.parametrize(
    ("k", "d", "model", "named"),
    [
        ([0.0] * 9, [], "plumb_bob", "fx"),
        (K, [0.1, 0.2, 0.3], "plumb_bob", "4 or 5"),
        (K, [0.1] * 5, "thin_prism", "'plumb_bob'"),
        (K, [np.nan] * 5, "plumb_bob", "finite"),
        (K[:8], [], "plumb_bob", "9"),
    ],
)
def test_descriptions_that_cannot_be(k: list[float], d: list[float], model: str, named: str) -> None:
    with pytest.raises(CameraModelError, match=named):
        CameraModel.from_camera_info_values(640, 480, k, d, model)


def test_image_without_size() -> None:
    with pytest.raises(CameraModelError, match="size"):
        CameraModel.from_camera_info_values(0, 480, K, [])


def test_camera_info_without_distortion() -> None:
    model = CameraModel.from_camera_info_values(640, 480, K, [], "")
    np.testing.assert_allclose(model.undistort([[319.5, 0]]), [[0, -239.5 / 539]])


_D14 = (0.3, -0.2, 0.001, 0.0005, 0.05, 0.6, -0.1, 0.02, 0.002, -0.001, -0.0015, 0.0008, 0.02, -0.03)


@pytest.mark.parametrize("name", ["plumb_bob", "rational_polynomial"])
@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_every_number_of_coefficients_is_opencvs(count: int, name: str) -> None:
    k = [539.0, 0, 319.5, 0, 541.0, 239.5, 0, 0, 1]
    model = CameraModel.from_camera_info_values(640, 480, k, _D14[:count], name)
    rays = np.random.default_rng(count).uniform((-0.5, -0.4, 1), (0.5, 0.4, 1), (200, 3))
    expected, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.reshape(k, (3, 3)), np.array(_D14[:count]))
    assert np.allclose(model.ray_to_pixel(rays), expected.reshape(-1, 2), atol=1e-6)
    assert np.allclose(model.undistort(model.ray_to_pixel(rays)), rays[:, :2], atol=1e-7)


@pytest.mark.parametrize("count", [1, 2, 3, 6, 7, 9, 13, 15])
def test_another_number_is_refused_with_those_that_can_be(count: int) -> None:
    with pytest.raises(CameraModelError, match=r"0 or 4 or 5 or 8 or 12 or 14 values for 'plumb_bob': got \d"):
        CameraModel.from_camera_info_values(640, 480, [539.0, 0, 319.5, 0, 539.0, 239.5, 0, 0, 1], [0.0] * count)


def test_a_rig_takes_what_a_camera_info_takes() -> None:
    assert CameraModel(CameraSpec(distortion=_D14)).distortion.tolist() == list(_D14)
