"""The closer look at a box: where its crop lies, what it makes of sides and scores."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.boxes.decoding import Raw
from vergence_metric.boxes.second_look import CROP_PX, MOST_LOOKS, look_again

SIZE = (640, 480)


def picture(box):
    """A grey image with a white rectangle whose outer sides are `box`."""
    image = np.full((SIZE[1], SIZE[0], 3), 40, np.uint8)
    x0, y0, x1, y1 = (round(v + 0.5) for v in box)
    image[y0:y1, x0:x1] = 255
    return image


def bright(crop):
    """See the white rectangle to a fraction of a pixel: half-bright pixels at its sides count by their brightness."""
    grey = (crop[..., 0].astype(float) - 40) / 215
    rows, columns = grey.max(1), grey.max(0)
    if rows.max() < 0.5:
        return Raw(np.empty((0, 4)), np.empty(0), np.empty(0, np.int64))

    def sides(line):
        first = int(line.argmax())
        while first > 0 and line[first - 1] > 0.02:
            first -= 1
        return first, first + line[first:].clip(0, 1).sum()

    (x0, width_end), (y0, height_end) = sides(columns), sides(rows)
    return Raw(np.array([[x0, y0, width_end, height_end]], float), np.array([0.9]), np.array([0]))


def nothing(_):
    return Raw(np.empty((0, 4)), np.empty(0), np.empty(0, np.int64))


@settings(deadline=None, max_examples=40)
@given(
    st.integers(30, 450),
    st.integers(20, 330),
    st.integers(24, 140),
    st.integers(24, 140),
    st.lists(st.floats(-0.05, 0.05), min_size=4, max_size=4),
)
def test_a_thing_seen_again_gets_finer_sides(x, y, width, height, off):
    true = np.array([x - 0.5, y - 0.5, x + width - 0.5, y + height - 0.5])
    first = true + np.array(off) * [width, height, width, height]
    boxes, scores = look_again(picture(true), first[None], np.array([0.6]), np.array([0]), bright)
    scale = max(2.3 * width / CROP_PX[0], 2.3 * height / CROP_PX[1], 1.0)
    # A third of the first look's error stays, and a pixel or so of the crop.
    np.testing.assert_allclose(boxes[0], true, atol=np.abs(off).max() * max(width, height) / 3 + 2.0 * scale)
    assert scores[0] == pytest.approx(0.5 * 0.6 + 0.5 * 0.9)


def test_a_thing_that_the_closer_look_denies_loses_half_its_score():
    box = np.array([[100.0, 100, 160, 160]])
    boxes, scores = look_again(picture(box[0]), box, np.array([0.8]), np.array([0]), nothing)
    np.testing.assert_array_equal(boxes, box)
    assert scores.tolist() == [0.4]


def test_another_class_or_place_is_not_the_same_thing():
    box = np.array([[100.0, 100, 160, 160]])
    _, other_class = look_again(picture(box[0]), box, np.array([0.8]), np.array([1]), bright)
    assert other_class.tolist() == [0.4]
    _, elsewhere = look_again(picture((100, 100, 160, 160)), box + 25.0, np.array([0.8]), np.array([0]), bright)
    assert elsewhere.tolist() == [0.4]


def test_looks_are_bounded_and_the_rest_stays():
    seen = []

    def count(crop):
        seen.append(crop.shape)
        return nothing(crop)

    boxes = np.tile([[10.0, 10, 50, 50]], (9, 1)) + 45.0 * np.arange(9)[:, None]
    _, scores = look_again(picture((0, 0, 4, 4)), boxes, np.full(9, 0.8), np.zeros(9, np.int64), count)
    assert seen == [(CROP_PX[1], CROP_PX[0], 3)] * (2 * MOST_LOOKS)
    assert scores.tolist() == [0.4] * MOST_LOOKS + [0.8] * (9 - MOST_LOOKS)


@pytest.mark.parametrize("box", [(-0.5, -0.5, 40, 40), (600, 440, 639.5, 479.5), (-0.5, -0.5, 639.5, 479.5)])
def test_boxes_at_the_border_and_of_the_whole_image_can_be_looked_at(box):
    boxes, _ = look_again(picture(box), np.array([box], float), np.array([0.8]), np.array([0]), bright)
    assert np.isfinite(boxes).all()
