"""Pictures: read, written, combined."""

import numpy as np
import pytest

from vergence_bringup.figures.pictures import (
    PictureError,
    combined_edges,
    read_image,
    with_box,
    with_cross,
    with_ring,
    with_windows,
    write_image,
)
from vergence_bringup.figures.svg_plot import Line, plot


def test_round_trip(tmp_path):
    image = np.random.default_rng(0).integers(0, 256, (12, 17, 3), dtype=np.uint8)
    write_image(tmp_path / "new" / "a.png", image)
    assert np.array_equal(read_image(tmp_path / "new" / "a.png"), image)


@pytest.mark.parametrize("content", [None, b"", b"not a picture"])
def test_what_cannot_be_read_is_named(tmp_path, content):
    path = tmp_path / "a.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(PictureError, match=r"a\.png"):
        read_image(path)


def test_combined_edges_tell_left_right_and_both():
    left, right = np.zeros((3, 3), np.uint8), np.zeros((3, 3), np.uint8)
    left[0, 0] = left[1, 1] = right[1, 1] = right[2, 2] = 255
    picture = combined_edges(left, right)
    assert picture[0, 0].tolist() == [0, 0, 255]
    assert picture[1, 1].tolist() == [255, 255, 255]
    assert picture[2, 2].tolist() == [255, 255, 0]
    assert picture[0, 1].tolist() == [0, 0, 0]


def test_drawing_leaves_the_picture_alone():
    picture = np.zeros((60, 80, 3), np.uint8)
    framed = with_windows(picture, [20])
    assert framed[20, 30].any()
    assert framed[39, 49].any()
    assert not framed[19, 29].any()
    assert with_cross(picture)[30, 40].any()
    assert not with_cross(picture, (10.4, 5.6))[30, 40].any()
    assert with_cross(picture, (10.4, 5.6))[6, 10].any()
    assert with_ring(picture, (40.0, 30.0))[30, 49].any()
    assert not with_ring(picture, (40.0, 30.0))[30, 40].any()
    assert not with_ring(picture, (float("nan"), 30.0), "unknown").any()
    boxed = with_box(picture, (10.2, 20.4, 40.0, 50.0), "cube")
    assert boxed[20:51, 10].all()
    assert not boxed[25:45, 15:35].any()
    assert not picture.any()


def test_a_plot_leaves_gaps_where_a_figure_is_not_known():
    whole = plot("t", "s", "px", [Line("a", np.arange(5.0), np.arange(5.0), "red")])
    broken = plot("t", "s", "px", [Line("a", np.arange(5.0), np.array([0, 1, np.nan, 3, 4]), "red")])
    assert whole.count("<polyline") == 1
    assert broken.count("<polyline") == 2
