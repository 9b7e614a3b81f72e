import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vergence_metric.alignment.parameters import AlignmentParameters
from vergence_metric.edges.edge_distance import WindowStatus
from vergence_metric.edges.edges import ImageShapeError
from vergence_metric.edges.parameters import EdgeParameters
from vergence_metric.measurement.edge_metric import EdgeMetric, EdgeMetricResult

Grey = NDArray[np.uint8]
CHESSBOARDS = Path(__file__).resolve().parents[4] / "shared" / "data" / "stereo_chessboard"
FIGURES = (
    "left_to_right_px",
    "right_to_left_px",
    "chance_left_to_right_px",
    "chance_right_to_left_px",
    "contrast_left_to_right",
    "contrast_right_to_left",
    "contrast",
    "robust_left_to_right_px",
    "robust_right_to_left_px",
)


def picture(seed: int, height: int = 520, width: int = 800) -> Grey:
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=(height, width)), (0, 0), 4.0)
    return np.clip(120 + 45 * noise / max(noise.std(), 1e-9), 0, 255).astype(np.uint8)


def measured(left: Grey, right: Grey, edges: EdgeParameters | None = None) -> EdgeMetricResult:
    return EdgeMetric(edges, alignment=AlignmentParameters(mode="none")).measure(left, right)


def test_a_pair_that_is_one_image_reads_nothing_everywhere() -> None:
    image = picture(1, 480, 640)
    found = measured(image, image)
    for name in ("left_to_right_px", "right_to_left_px", "contrast", "robust_left_to_right_px"):
        np.testing.assert_allclose(getattr(found, name), 0.0, atol=1e-6)
    assert found.foveal_contrast == pytest.approx(0.0, abs=1e-6)
    assert (found.chance_left_to_right_px > 1.0).all()
    assert found.status.tolist() == [WindowStatus.OK] * 6
    assert found.windows_px.tolist() == [50, 100, 150, 200, 250, 300]


def test_an_unrelated_pair_reads_what_chance_gives() -> None:
    found = measured(picture(2, 480, 640), picture(3, 480, 640))
    np.testing.assert_allclose(found.left_to_right_px[1:], found.chance_left_to_right_px[1:], rtol=0.2)
    np.testing.assert_allclose(found.right_to_left_px[1:], found.chance_right_to_left_px[1:], rtol=0.2)
    np.testing.assert_allclose(found.contrast, 1.0, atol=0.12)


def test_left_and_right_exchanged_exchange_the_directions() -> None:
    scene = picture(4)
    left, right = scene[20:500, 80:720], scene[20:500, 83:723]
    one, other = measured(left, right), measured(right, left)
    np.testing.assert_array_equal(one.left_to_right_px, other.right_to_left_px)
    np.testing.assert_array_equal(one.robust_left_to_right_px, other.robust_right_to_left_px)
    np.testing.assert_array_equal(one.left_edge_count, other.right_edge_count)
    np.testing.assert_array_equal(one.contrast, other.contrast)


def test_colour_and_grey_of_the_same_picture_agree() -> None:
    left, right = picture(5, 480, 640), picture(6, 480, 640)
    colour = measured(cv2.cvtColor(left, cv2.COLOR_GRAY2BGR), cv2.cvtColor(right, cv2.COLOR_GRAY2BGR))
    np.testing.assert_array_equal(colour.left_to_right_px, measured(left, right).left_to_right_px)


@pytest.mark.parametrize(("blank_left", "blank_right"), [(True, False), (False, True), (True, True)])
def test_a_covered_eye_gives_nan_and_the_reason_never_zero(blank_left: bool, blank_right: bool) -> None:
    blank, scene = np.full((480, 640), 12, np.uint8), picture(7, 480, 640)
    found = measured(blank if blank_left else scene, blank if blank_right else scene)
    expected = {
        (True, False): WindowStatus.NO_LEFT_EDGES,
        (False, True): WindowStatus.NO_RIGHT_EDGES,
        (True, True): WindowStatus.NO_EDGES,
    }[blank_left, blank_right]
    assert found.status.tolist() == [expected] * 6
    for name in FIGURES:
        if not name.startswith("chance"):
            assert np.isnan(getattr(found, name)).all(), name
    assert np.isnan(found.chance_left_to_right_px).all() == blank_right
    assert np.isnan(found.chance_right_to_left_px).all() == blank_left
    assert math.isnan(found.foveal_contrast)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (7, 500), (240, 320), (241, 37), (720, 1280)])
def test_any_image_size_is_measured(height: int, width: int) -> None:
    left, right = picture(8, height, width), picture(9, height, width)
    found = EdgeMetric().measure(left, right)
    assert found.left_to_right_px.shape == (6,)
    fits = np.array([size <= min(height, width) for size in found.windows_px])
    with_edges = (found.left_edge_count > 0) & (found.right_edge_count > 0)
    np.testing.assert_array_equal(found.status == WindowStatus.OK, fits & with_edges)
    np.testing.assert_array_equal(found.status == WindowStatus.WINDOW_CLIPPED, ~fits & with_edges)
    np.testing.assert_array_equal(np.isfinite(found.left_to_right_px), with_edges)


def test_images_of_two_sizes_are_refused_by_name() -> None:
    with pytest.raises(ImageShapeError, match=r"got \(480, 640\) and \(480, 600\)"):
        measured(np.zeros((480, 640), np.uint8), np.zeros((480, 600), np.uint8))


def test_the_right_image_is_aligned_before_it_is_compared() -> None:
    scene = picture(10)
    left, right = scene[20:500, 80:720], scene[33:513, 80:720]  # y_left - y_right = 13
    raw = measured(left, right)
    aligned = EdgeMetric().measure(left, right)
    assert aligned.alignment.vertical_px == pytest.approx(13.0, abs=0.1)
    assert (raw.contrast > 0.8).all()
    assert (aligned.contrast[:4] < 0.2).all()
    np.testing.assert_allclose(aligned.right_grey[100:380, 100:540], left[100:380, 100:540], atol=30)


def test_every_stage_is_timed_once_it_is_measured() -> None:
    found = measured(picture(1, 480, 640), picture(2, 480, 640))
    assert set(found.stage_s) == {"grey", "align", "edges", "contrast"}
    assert found.left_to_right_px.size == found.chance_left_to_right_px.size
    assert set(found.stage_s) >= {"distance", "chance"}
    assert "robust" not in found.stage_s
    assert all(seconds > 0.0 for seconds in found.stage_s.values())


@pytest.mark.parametrize("windows_px", [(50, 100, 150, 200), (150, 60), (300,), (40, 70)])
def test_the_least_contrast_is_that_of_the_small_windows(windows_px: tuple[int, ...]) -> None:
    scene = picture(5)
    found = measured(scene[:480, 10:650], scene[:480, :640], EdgeParameters(windows_px=windows_px))
    small = [contrast for size, contrast in zip(windows_px, found.contrast, strict=True) if 50 <= size <= 150]
    if small:
        assert found.least_contrast.contrast == min(small)
        assert found.least_contrast.window_px == windows_px[found.contrast.tolist().index(min(small))]
    else:
        assert math.isnan(found.least_contrast.contrast)


def test_all_windows_of_a_pair_are_measured_with_the_same_thresholds() -> None:
    metric, scene, random = EdgeMetric(alignment=AlignmentParameters(mode="none")), picture(5), np.random.default_rng(1)
    left, right = scene[:480, 10:650], scene[:480, :640]
    first = metric.measure(left, right)

    def again(image: Grey) -> Grey:
        return np.clip(image + random.normal(0.0, 3.0, image.shape), 0, 255).astype(np.uint8)

    found = metric.measure(again(left), again(right))
    assert found.thresholds == first.thresholds
    assert (found.left_edges.high, found.right_edges.high) == (found.thresholds[0][1], found.thresholds[1][1])
    assert found.least_contrast.contrast == pytest.approx(min(found.contrast[:3]), abs=0.01)


def test_a_result_is_not_changed_by_the_next_pair() -> None:
    metric = EdgeMetric(alignment=AlignmentParameters(mode="none"))
    first = metric.measure(picture(1, 480, 640), picture(2, 480, 640))
    metric.measure(picture(3, 480, 640), picture(4, 480, 640))
    alone = measured(picture(1, 480, 640), picture(2, 480, 640))
    for name in ("left_to_right_px", "chance_right_to_left_px", "contrast", "robust_left_to_right_px"):
        np.testing.assert_array_equal(getattr(first, name), getattr(alone, name))


def grey(path: Path) -> Grey:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    assert image is not None, path
    return np.asarray(image, np.uint8)


def board_corners(image: Grey) -> NDArray[np.float64]:
    found, corners = cv2.findChessboardCorners(image, (9, 6))
    assert found
    # Found ones differ by pixels from one OpenCV to the next.
    enough = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.01)
    refined = cv2.cornerSubPix(image, np.asarray(corners, np.float32), (5, 5), (-1, -1), enough)
    return np.asarray(refined, float).reshape(-1, 2)


@pytest.mark.skipif(not CHESSBOARDS.is_dir(), reason="shared/data/stereo_chessboard is not beside this checkout")
@pytest.mark.parametrize("number", range(1, 7))
@pytest.mark.parametrize(("row", "column"), [(1, 2), (2, 4), (4, 6)])
def test_contrast_is_least_at_the_disparity_of_a_real_board_s_corners(number: int, row: int, column: int) -> None:
    left, right = (grey(CHESSBOARDS / f"{eye}{number:02}.jpg") for eye in ("left", "right"))
    left_corners, right_corners = board_corners(left), board_corners(right)
    # two squares from the rim of the inner corners at most: the board fills the window about this corner
    x, y = (round(float(value)) for value in left_corners[9 * row + column])
    inside = (np.abs(left_corners - (x, y)) <= 25).all(axis=1)
    disparity, vertical = (left_corners - right_corners)[inside].mean(axis=0)
    # A slanted board has a range of disparities in the window; it is given by the corners around it.
    around = (np.abs(left_corners - (x, y)) <= 50).all(axis=1)
    half_range = 0.25 * float(np.ptp((left_corners - right_corners)[around, 0]))

    def view(image: Grey, view_x: float, view_y: float) -> Grey:
        return np.asarray(cv2.getRectSubPix(image, (120, 120), (view_x, view_y)), np.uint8)

    seen = view(left, x, y)
    shifts = np.arange(round(float(disparity)) - 12, round(float(disparity)) + 13)
    contrast = [
        measured(seen, view(right, x - float(shift), y - float(vertical)), EdgeParameters(windows_px=(50,))).contrast[0]
        for shift in shifts
    ]
    assert min(contrast) < 0.6
    assert shifts[int(np.argmin(contrast))] == pytest.approx(disparity, abs=max(1.0, half_range))
