import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vergence_metric.edges.edges import ImageShapeError, detect_edges, to_grey
from vergence_metric.edges.parameters import EdgeParameters
from vergence_rig.parameters import ParameterError

AUTO = EdgeParameters()


def texture(seed: int = 0) -> NDArray[np.float64]:
    noise = np.random.default_rng(seed).normal(size=(240, 320))
    smooth = cv2.GaussianBlur(noise, (0, 0), 3.0)
    return 128.0 + 40.0 * smooth / smooth.std()


def as_image(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def test_a_step_gives_one_line_of_edge_pixels_at_the_step() -> None:
    image = np.full((60, 80), 40, np.uint8)
    image[:, 40:] = 200
    edges = detect_edges(image, AUTO)
    rows, columns = np.nonzero(edges.mask)
    assert set(rows) == set(range(60))
    assert len(columns) == 60
    assert set(columns) <= {39, 40}


def test_automatic_thresholds_follow_the_exposure() -> None:
    bright, dark = detect_edges(as_image(texture()), AUTO), detect_edges(as_image(20.0 + 0.5 * texture()), AUTO)
    assert dark.high == pytest.approx(0.5 * bright.high, rel=0.05)
    assert dark.count == pytest.approx(bright.count, rel=0.1)
    fixed = EdgeParameters(threshold_mode="fixed", canny_low=0.5 * bright.high, canny_high=bright.high)
    assert detect_edges(as_image(20.0 + 0.5 * texture()), fixed).count < 0.7 * bright.count


def test_a_blank_wall_with_sensor_noise_has_no_edges() -> None:
    wall = np.random.default_rng(1).normal(120.0, 3.0, (240, 320))
    assert detect_edges(as_image(wall), AUTO).count == 0


def test_fixed_thresholds_are_used_as_given() -> None:
    edges = detect_edges(as_image(texture()), EdgeParameters(threshold_mode="fixed", canny_low=11, canny_high=33))
    assert (edges.low, edges.high) == (11.0, 33.0)


def test_no_blur_is_allowed() -> None:
    sharp = detect_edges(as_image(texture()), EdgeParameters(blur_sigma_px=0.0))
    assert sharp.count > 0


def test_grey_of_bgr_and_of_grey() -> None:
    bgr = np.zeros((4, 5, 3), np.uint8)
    bgr[..., 1] = 100
    assert to_grey(bgr).tolist() == np.full((4, 5), 59).tolist()
    grey = np.zeros((4, 5), np.uint8)
    assert to_grey(grey) is grey


@pytest.mark.parametrize(
    "image",
    [np.zeros((4, 5, 4), np.uint8), np.zeros((4, 5)), np.zeros((0, 5), np.uint8), np.zeros(4, np.uint8)],
    ids=["bgra", "float", "empty", "one-dimensional"],
)
def test_other_images_are_refused(image: NDArray) -> None:
    with pytest.raises(ImageShapeError):
        to_grey(image)


def test_colour_is_refused_where_grey_is_meant() -> None:
    with pytest.raises(ImageShapeError, match="must be"):
        detect_edges(np.zeros((4, 5, 3), np.uint8), AUTO)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("windows_px", ()),
        ("windows_px", (50, 50)),
        ("windows_px", (0,)),
        ("canny_low", 60.0),
        ("threshold_mode", "otsu"),
    ],
)
def test_parameters_that_cannot_be_are_named(name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=name):
        EdgeParameters.from_mapping({name: value})
