import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vergence_metric.edges.edge_distance import EdgeDistances, WindowStatus, edge_distances
from vergence_metric.edges.nearest_edges import NearestEdges
from vergence_metric.edges.windows import Window, centre_windows

Mask = NDArray[np.uint8]


def pairwise(from_mask: Mask, to_mask: Mask, window: Window) -> float:
    """Return the metric by its definition: every distance is written out."""
    a = np.argwhere(from_mask[window.slices]).astype(np.float64)
    b = np.argwhere(to_mask[window.slices]).astype(np.float64)
    if not len(a) or not len(b):
        return math.nan
    return float(np.sqrt(((a[:, None] - b[None]) ** 2).sum(axis=2)).min(axis=1).mean())


def measure(left: Mask, right: Mask, windows: Sequence[Window]) -> EdgeDistances:
    return edge_distances(NearestEdges(left, right, windows))


def random_mask(rng: np.random.Generator, height: int, width: int, share: float) -> Mask:
    return (rng.random((height, width)) < share).astype(np.uint8) * np.uint8(255)


@settings(deadline=None, max_examples=150)
@given(
    height=st.integers(1, 70),
    width=st.integers(1, 70),
    sizes=st.lists(st.integers(1, 90), min_size=1, max_size=6),
    left_share=st.sampled_from((0.0, 0.0005, 0.003, 0.02, 0.1, 0.6)),
    right_share=st.sampled_from((0.0, 0.0005, 0.003, 0.02, 0.1, 0.6)),
    seed=st.integers(0, 2**32 - 1),
)
def test_equal_to_the_definition(
    height: int, width: int, sizes: list[int], left_share: float, right_share: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    left, right = random_mask(rng, height, width, left_share), random_mask(rng, height, width, right_share)
    windows = centre_windows(sizes, height, width)
    measured = measure(left, right, windows)
    for i, window in enumerate(windows):
        np.testing.assert_allclose(measured.left_to_right_px[i], pairwise(left, right, window), rtol=0, atol=1e-9)
        np.testing.assert_allclose(measured.right_to_left_px[i], pairwise(right, left, window), rtol=0, atol=1e-9)
        assert measured.left_count[i] == np.count_nonzero(left[window.slices])
        assert measured.right_count[i] == np.count_nonzero(right[window.slices])


def test_equal_to_the_definition_at_full_size() -> None:
    rng = np.random.default_rng(3)
    left, right = random_mask(rng, 480, 640, 0.01), random_mask(rng, 480, 640, 0.0005)
    windows = centre_windows((50, 100, 150, 200, 250, 300), 480, 640)
    measured = measure(left, right, windows)
    for i, window in enumerate(windows):
        np.testing.assert_allclose(measured.left_to_right_px[i], pairwise(left, right, window), rtol=0, atol=1e-9)
        np.testing.assert_allclose(measured.right_to_left_px[i], pairwise(right, left, window), rtol=0, atol=1e-9)


def test_a_neighbour_outside_the_window_does_not_count() -> None:
    left, right = np.zeros((100, 100), np.uint8), np.zeros((100, 100), np.uint8)
    left[41, 50] = 255  # in the 20 px window, one row below its upper border
    right[39, 50] = 255  # just above it
    right[59, 50] = 255  # far, but inside
    small, large = measure(left, right, centre_windows((20, 40), 100, 100)).left_to_right_px
    assert small == 18.0
    assert large == 2.0


@pytest.mark.parametrize(
    ("in_left", "in_right", "status"),
    [
        (True, True, WindowStatus.OK),
        (False, True, WindowStatus.NO_LEFT_EDGES),
        (True, False, WindowStatus.NO_RIGHT_EDGES),
        (False, False, WindowStatus.NO_EDGES),
    ],
)
def test_no_edges_is_nan_with_the_reason(in_left: bool, in_right: bool, status: WindowStatus) -> None:
    left, right = np.zeros((40, 40), np.uint8), np.zeros((40, 40), np.uint8)
    left[20, 20], right[20, 23] = 255 * in_left, 255 * in_right
    left[0, 0] = right[0, 0] = 255  # outside the window: of no account
    measured = measure(left, right, centre_windows((20,), 40, 40))
    assert measured.status.tolist() == [status]
    expected = 3.0 if status is WindowStatus.OK else math.nan
    np.testing.assert_equal(measured.left_to_right_px, [expected])
    np.testing.assert_equal(measured.right_to_left_px, [expected])


def test_a_window_larger_than_the_image_is_measured_and_marked() -> None:
    mask = np.eye(30, 50, k=10, dtype=np.uint8)
    measured = measure(mask, mask, centre_windows((20, 40), 30, 50))
    assert measured.status.tolist() == [WindowStatus.OK, WindowStatus.WINDOW_CLIPPED]
    assert measured.left_count.tolist() == [20, 30]
    np.testing.assert_equal(measured.left_to_right_px, [0.0, 0.0])


def test_status_values_are_those_of_the_message() -> None:
    assert [status.value for status in WindowStatus] == [0, 1, 2, 3, 4]
