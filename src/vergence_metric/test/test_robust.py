import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from vergence_metric.edges.parameters import ContrastParameters, EdgeParameters
from vergence_metric.measurement.edge_metric import EdgeMetric

Grey = NDArray[np.uint8]


def texture(seed: int, side: int = 500) -> Grey:
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(size=(side, side)), (0, 0), 4.0)
    return np.clip(120 + 45 * noise / noise.std(), 0, 255).astype(np.uint8)


def verged_before_a_wall(radius: int = 60, wall_shift: int = 23, disc_shift: int = 1) -> tuple[Grey, Grey]:
    """Return views of a textured disc, verged but for a pixel, before a textured wall at another depth."""
    disc, wall = texture(1), texture(2)
    views = [wall[100:420, 100:420].copy(), wall[100:420, 100 + wall_shift : 420 + wall_shift].copy()]
    rows, columns = np.mgrid[:320, :320]
    inside = np.hypot(rows - 160, columns - 160) < radius
    for view, shift in zip(views, (0, disc_shift), strict=True):
        view[inside] = disc[:320, shift : shift + 320][inside]
    return views[0], views[1]


def spread(figures: NDArray[np.float64]) -> float:
    return float((figures.max() - figures.min()) / figures.mean())


def test_windows_agree_where_the_plain_metric_s_do_not() -> None:
    parameters = EdgeParameters(windows_px=(100, 150, 200, 250, 300))
    found = EdgeMetric(parameters).measure(*verged_before_a_wall())
    assert spread(found.left_to_right_px) > 0.5
    assert spread(found.right_to_left_px) > 0.5
    assert spread(found.robust_left_to_right_px) < 0.25
    assert spread(found.robust_right_to_left_px) < 0.25


def test_no_distance_counts_for_more_than_the_cut_off() -> None:
    unrelated = EdgeMetric(contrast=ContrastParameters(robust_truncation_px=4)).measure(texture(1), texture(3))
    assert (unrelated.robust_left_to_right_px <= 4.0).all()
    assert (unrelated.robust_left_to_right_px > 2.0).all()


def test_a_wide_fovea_is_the_plain_truncated_mean() -> None:
    left, right = verged_before_a_wall()
    wide = EdgeMetric(contrast=ContrastParameters(robust_sigma_px=1e6)).measure(left, right)
    narrow = EdgeMetric(contrast=ContrastParameters(robust_sigma_px=20.0)).measure(left, right)
    assert narrow.robust_left_to_right_px[-1] < 0.5 * wide.robust_left_to_right_px[-1]


def test_no_edges_is_nan() -> None:
    blank = np.full((320, 320), 90, np.uint8)
    found = EdgeMetric().measure(texture(1, 320), blank)
    assert np.isnan(found.robust_left_to_right_px).all()
    assert np.isnan(found.robust_right_to_left_px).all()


@pytest.mark.parametrize("order", [(300, 50, 100), (50, 100, 300)])
def test_figures_belong_to_their_windows_in_any_order(order: tuple[int, ...]) -> None:
    left, right = verged_before_a_wall()
    found = EdgeMetric(EdgeParameters(windows_px=order)).measure(left, right)
    for i, size in enumerate(order):
        alone = EdgeMetric(EdgeParameters(windows_px=(size,))).measure(left, right)
        assert found.left_to_right_px[i] == alone.left_to_right_px[0]
        assert found.contrast[i] == pytest.approx(alone.contrast[0], abs=1e-6)
        assert found.robust_left_to_right_px[i] == pytest.approx(alone.robust_left_to_right_px[0], rel=1e-6)
