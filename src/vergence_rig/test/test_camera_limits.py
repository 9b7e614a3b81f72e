"""Numbers that no lens has are refused; those of real lenses are taken. Whatever is taken gives rays or NaN."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.camera import CameraModel, CameraModelError
from vergence_rig.parameters import ParameterError
from vergence_rig.rig import CameraSpec

PLAIN = (0.0, 0.0, 0.0, 0.0, 0.0)


def model(focal: float = 539.0, d: tuple[float, ...] = PLAIN, name: str = "plumb_bob") -> CameraModel:
    return CameraModel.from_camera_info_values(640, 480, [focal, 0, 319.5, 0, focal, 239.5, 0, 0, 1], d, name)


@pytest.mark.parametrize("focal", [1.0, 1e-300, 1e300, -539.0, math.nan, math.inf])
def test_focal_lengths_that_no_lens_has(focal: float) -> None:
    with pytest.raises(CameraModelError, match=r"fx must be 64 to 64000 \[px\]"):
        model(focal)


@pytest.mark.parametrize("place", range(5))
@pytest.mark.parametrize("value", [1e308, -1e308, 1e-310, -5e-324, math.nan, math.inf, 1000.0])
def test_distortion_that_no_lens_has(place: int, value: float) -> None:
    d = list(PLAIN)
    d[place] = value
    if value == 1000.0 and place == 4:
        d[place] = 1e5  # k3 counts by the sixth power of the radius
    with pytest.raises(CameraModelError, match="distortion must be"):
        model(d=tuple(d))


@pytest.mark.parametrize("name", ["rational_polynomial", "equidistant"])
@pytest.mark.parametrize("value", [1e308, 1e-310, -1e308, 1e5])
def test_distortion_of_other_models(name: str, value: float) -> None:
    count = {"rational_polynomial": 8, "equidistant": 4}[name]
    with pytest.raises(CameraModelError, match="distortion must be"):
        model(d=(value,) + (0.0,) * (count - 1), name=name)


def test_a_lens_without_a_ray_at_the_border() -> None:
    with pytest.raises(CameraModelError, match="ray at the image's nearer border"):
        model(d=(-1.0, 0.0, 0.0, 0.0, 0.0))


def test_an_uncalibrated_camera_is_called_so() -> None:
    with pytest.raises(CameraModelError, match=r"not calibrated .* run vergence calibrate cameras"):
        model(0.0)


@pytest.mark.parametrize(
    ("focal", "d", "name"),
    [
        (539.0, (-0.361976, 0.110510, 0.001014, 0.000505, 0.0), "plumb_bob"),
        (300.0, (-0.30, 0.09, 0.001, -0.0007, -0.012), "plumb_bob"),
        (2000.0, (-1.0, 3.0, 0.0, 0.0, 0.0), "plumb_bob"),
        (539.0, (0.0, 0.0, 0.0, 0.0, 1e-200), "plumb_bob"),
        (539.0, (0.3, -0.2, 0.001, 0.0005, 0.05, 0.6, -0.1, 0.02), "rational_polynomial"),
        (180.0, (-0.02, 0.01, -0.004, 0.001), "equidistant"),
    ],
)
def test_real_lenses_are_taken(focal: float, d: tuple[float, ...], name: str) -> None:
    assert np.isfinite(model(focal, d, name).angles([[319.5, 239.5], [319.5, 20.0]])).all()


KINDS = [(5, "plumb_bob"), (8, "rational_polynomial"), (4, "equidistant")]
_ANY = st.floats(allow_nan=True, allow_infinity=True) | st.floats(-2, 2)


@given(_ANY | st.floats(50, 5000), st.lists(_ANY, min_size=8, max_size=8), st.sampled_from(KINDS))
@settings(deadline=None, max_examples=300)
def test_any_numbers_are_refused_by_name_or_give_rays_or_nan(
    focal: float, d: list[float], kind: tuple[int, str]
) -> None:
    try:
        made = model(focal, tuple(d[: kind[0]]), kind[1])
    except CameraModelError:
        return
    angles = made.angles([[0.0, 0.0], [319.5, 239.5], [639.0, 479.0]])
    assert (np.isnan(angles) | (np.abs(angles) <= math.pi / 2)).all()
    made.ray_to_pixel([[0.1, 0.2, 1.0]])


def test_the_same_holds_for_rig_yaml() -> None:
    with pytest.raises(ParameterError, match=r"'fx_px' must be 64 to 64000"):
        CameraSpec(fx_px=1.0)
    with pytest.raises(ParameterError, match="'distortion' must be of a lens"):
        CameraSpec(distortion=(-1.0, 0.0, 0.0, 0.0, 0.0))
