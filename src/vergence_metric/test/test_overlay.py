import cv2
import numpy as np
import pytest

from vergence_metric.disparity import Disparity, DisparityStatus
from vergence_metric.edges.parameters import EdgeParameters
from vergence_metric.measurement.edge_metric import EdgeMetric
from vergence_metric.measurement.overlay import BOTH_BGR, LEFT_BGR, RIGHT_BGR, draw_overlay, overlay_lines

GOOD = Disparity(12.0, 0.0, 0.1, 0.97, DisparityStatus.OK, "", "zncc", (159.5, 119.5))
NONE = Disparity.none(DisparityStatus.NO_TEXTURE, "blank", "zncc", (159.5, 119.5))


def box(x: int) -> np.ndarray:
    image = np.full((240, 320, 3), 60, np.uint8)
    return cv2.rectangle(image, (x, 100), (x + 40, 140), (220, 220, 220), -1)


def drawn(left: np.ndarray, right: np.ndarray, disparity: Disparity = NONE) -> np.ndarray:
    # a window that leaves the edges free of its frame
    result = EdgeMetric(EdgeParameters(windows_px=(200,))).measure(left, right)
    return draw_overlay(left, result, disparity)


def colours(picture: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(int(v) for v in pixel) for pixel in picture[95:146, 130:200].reshape(-1, 3)}


def test_edges_of_each_eye_have_their_colour_and_common_ones_are_white() -> None:
    apart = colours(drawn(box(140), box(148)))
    assert {LEFT_BGR, RIGHT_BGR} <= apart
    verged = colours(drawn(box(140), box(140)))
    assert BOTH_BGR in verged
    assert not {LEFT_BGR, RIGHT_BGR} & verged


def test_the_view_is_not_written_to_and_keeps_its_size() -> None:
    left = box(140)
    before = left.copy()
    left.flags.writeable = False
    assert drawn(left, box(148)).shape == before.shape
    np.testing.assert_array_equal(left, before)


def test_a_grey_view_is_drawn_in_colour() -> None:
    grey = np.ascontiguousarray(box(140)[:, :, 0])
    assert drawn(grey, grey).shape == (240, 320, 3)


def test_the_disparity_is_an_arrow_only_where_there_is_one() -> None:
    blank = np.full((240, 320, 3), 60, np.uint8)
    without, given = drawn(blank, blank, NONE), drawn(blank, blank, GOOD)
    rows, columns = np.nonzero((without != given).any(axis=2)[100:140])
    assert 146 <= columns.min() <= 149
    assert 159 <= columns.max() <= 162
    assert rows.size


@pytest.mark.parametrize(
    ("disparity", "first"), [(GOOD, "error +12.0 px, 97% confidence"), (NONE, "error unknown: blank")]
)
def test_lines_show_the_error_and_every_window(disparity: Disparity, first: str) -> None:
    result = EdgeMetric(EdgeParameters(windows_px=(50, 200))).measure(box(140), box(148))
    lines = overlay_lines(result, disparity)
    assert lines[0] == first
    assert len(lines) == 3
    assert f"{result.left_to_right_px[1]:.2f}" in lines[2]
