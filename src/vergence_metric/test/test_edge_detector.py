import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vergence_metric.edges.edge_detector import EdgeDetector
from vergence_metric.edges.edges import detect_edges
from vergence_metric.edges.parameters import EdgeParameters

AUTO = EdgeParameters()
AREA = slice(60, 180), slice(80, 240)


def texture(seed: int = 0, contrast: float = 40.0, noise: float = 0.0) -> NDArray[np.uint8]:
    smooth = cv2.GaussianBlur(np.random.default_rng(0).normal(size=(240, 320)), (0, 0), 3.0)
    values = 128.0 + contrast * smooth / smooth.std() + np.random.default_rng(seed).normal(0.0, noise, (240, 320))
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("size", [(97, 130), (64, 64), (61, 83)])
@pytest.mark.parametrize("parameters", [AUTO, EdgeParameters(blur_sigma_px=0.0), EdgeParameters(auto_edge_share=0.3)])
def test_the_edges_of_an_area_are_those_of_the_image(size: tuple[int, int], parameters: EdgeParameters) -> None:
    image = texture()[: size[0], : size[1]]
    area = slice(10, size[0] - 8), slice(0, size[1] - 13)
    whole, part = detect_edges(image, parameters), EdgeDetector(parameters).detect_within(image, area)
    assert (part.low, part.high) == (whole.low, whole.high)
    np.testing.assert_array_equal(part.gradient_x, whole.gradient_x[area])
    np.testing.assert_array_equal(part.gradient_y, whole.gradient_y[area])
    # At the area's border, and in weak edges that join strong ones outside of it only, they may differ.
    assert (part.mask != whole.mask[area]).mean() < 0.04


def test_thresholds_hold_while_the_image_changes_by_noise_alone() -> None:
    detector = EdgeDetector(AUTO)
    first = detector.detect_within(texture(1, noise=3.0), AREA)
    for seed in range(2, 8):
        image = texture(seed, noise=3.0)
        edges = detector.detect_within(image, AREA)
        assert (edges.low, edges.high) == (first.low, first.high)
        whole = detect_edges(image, AUTO, (first.low, first.high))
        np.testing.assert_array_equal(edges.gradient_x, whole.gradient_x[AREA])
        assert (edges.mask != whole.mask[AREA]).mean() < 0.04


def test_another_view_has_its_own_thresholds() -> None:
    detector, flatter = EdgeDetector(AUTO), texture(contrast=20.0)
    before = detector.detect_within(texture(), AREA)
    edges, alone = detector.detect_within(flatter, AREA), detect_edges(flatter, AUTO)
    assert edges.high == alone.high < 0.7 * before.high


def test_what_an_overview_does_not_show_gives_new_thresholds_after_half_a_second() -> None:
    detector, sharp, blurred = EdgeDetector(AUTO), texture(noise=30.0), texture()
    before = detector.detect_within(sharp, AREA)
    high = [detector.detect_within(blurred, AREA).high for _ in range(15)]
    assert high[0] in (before.high, high[-1])
    assert high[-1] == detect_edges(blurred, AUTO).high < before.high
