import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.edges.windows import WindowError, centre_window, centre_windows


def test_windows_start_where_the_paper_s_flowchart_says() -> None:
    window = centre_window(50, 480, 640)
    assert (window.top, window.left, window.bottom, window.right) == (215, 295, 265, 345)
    assert not window.clipped


def test_odd_sizes_in_odd_images() -> None:
    window = centre_window(3, 5, 7)
    assert (window.top, window.left, window.bottom, window.right) == (1, 2, 4, 5)


@settings(deadline=None, max_examples=200)
@given(st.integers(1, 400), st.integers(1, 300), st.integers(1, 300))
def test_a_window_lies_in_the_image_and_is_whole_where_it_fits(size: int, height: int, width: int) -> None:
    window = centre_window(size, height, width)
    image = np.zeros((height, width))
    assert image[window.slices].shape == (min(size, height), min(size, width))
    assert window.clipped == (size > min(height, width))


def test_windows_keep_the_order_asked_for() -> None:
    assert [window.size_px for window in centre_windows((300, 50), 480, 640)] == [300, 50]


@pytest.mark.parametrize(("size", "height", "width"), [(0, 10, 10), (5, 0, 10), (5, 10, 0), (-3, 10, 10)])
def test_no_extent_is_an_error_that_names_the_values(size: int, height: int, width: int) -> None:
    with pytest.raises(WindowError, match=f"got {size} px in {width}x{height}"):
        centre_window(size, height, width)
