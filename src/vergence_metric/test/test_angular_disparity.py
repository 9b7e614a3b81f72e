import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.disparity.angular_disparity import angular_disparity
from vergence_rig.camera import CameraModel

D = (-0.2, 0.06, 0.001, -0.0005, 0.0)


def camera(fx: float = 500.0, cx: float = 319.5, d: tuple[float, ...] = (0.0,) * 5) -> CameraModel:
    return CameraModel.from_camera_info_values(640, 480, (fx, 0, cx, 0, fx, 239.5, 0, 0, 1), d)


def test_the_centre_of_pinholes_by_hand() -> None:
    found = angular_disparity(camera(), camera(), (319.5, 239.5), 10.0, -4.0)
    assert found.horizontal_px == pytest.approx(10.0)
    assert found.vertical_px == pytest.approx(-4.0)
    assert found.horizontal_rad == pytest.approx(math.atan(10 / 500))
    assert found.vertical_rad == pytest.approx(-math.atan(4 / 500))


def test_principal_points_that_differ_are_taken_out() -> None:
    found = angular_disparity(camera(cx=319.5), camera(cx=329.5), (319.5, 239.5), -10.0, 0.0)
    assert found.horizontal_px == pytest.approx(0.0, abs=1e-9)
    assert found.horizontal_rad == pytest.approx(0.0, abs=1e-12)


@settings(deadline=None, max_examples=60)
@given(st.floats(-0.3, 0.3), st.floats(-0.2, 0.2), st.floats(-0.15, 0.15))
def test_lens_distortion_is_taken_out(x: float, y: float, turn: float) -> None:
    left, right = camera(d=D), camera(fx=530.0, cx=310.0, d=(-0.1, 0.0, 0.0, 0.0, 0.0))
    left_px = left.distort([(math.tan(x), math.tan(y))])[0]
    right_px = right.distort([(math.tan(x - turn), math.tan(y))])[0]
    horizontal_px, vertical_px = (float(v) for v in np.subtract(left_px, right_px))
    found = angular_disparity(left, right, (float(left_px[0]), float(left_px[1])), horizontal_px, vertical_px)
    assert found.horizontal_rad == pytest.approx(turn, abs=1e-7)
    assert found.vertical_rad == pytest.approx(0.0, abs=1e-7)


def test_no_disparity_gives_nan() -> None:
    found = angular_disparity(camera(), camera(), (math.nan, math.nan), math.nan, math.nan)
    assert math.isnan(found.horizontal_rad)
    assert math.isnan(found.horizontal_px)
