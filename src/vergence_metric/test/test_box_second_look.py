"""The second look at a box: where its crop lies, and its effect on sides and scores."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.boxes import Detector
from vergence_metric.boxes.layouts import Candidates
from vergence_metric.boxes.parameters import DetectorParameters
from vergence_metric.boxes.second_look import CROP_PX, MOST_LOOKS, Window, look_again
from vergence_metric.boxes.session import SHIPPED_MODEL

onnx = pytest.importorskip("onnx", reason="the onnx package is not installed: pip install onnx")

SIZE = (640, 480)
FIRST_SCALE = 2.0
BORDER_BRIGHTNESS = 0.15  # a crop's outermost pixels mix with the grey beyond the image


def picture(box):
    """A grey image with a white rectangle whose outer sides are `box`."""
    image = np.full((SIZE[1], SIZE[0], 3), 40, np.uint8)
    x0, y0, x1, y1 = (round(v + 0.5) for v in box)
    image[y0:y1, x0:x1] = 255
    return image


def bright(crops):
    return [brightest(crop) for crop in crops]


def brightest(crop):
    """See the white rectangle to a fraction of a pixel: half-bright pixels at its sides count by their brightness."""
    grey = (crop[..., 0].astype(float) - 40) / 215
    rows, columns = grey.max(1), grey.max(0)
    if rows.max() < 0.5:
        return Candidates(np.empty((0, 4)), np.empty(0), np.empty(0, np.int64))

    def sides(line):
        first = int(line.argmax())
        while first > 0 and line[first - 1] > BORDER_BRIGHTNESS:
            first -= 1
        return first, first + line[first:].clip(0, 1).sum()

    (x0, width_end), (y0, height_end) = sides(columns), sides(rows)
    return Candidates(np.array([[x0, y0, width_end, height_end]], float), np.array([0.9]), np.array([0]))


def seen(boxes, scores=0.8, class_id=0):
    boxes = np.atleast_2d(np.asarray(boxes, float))
    return Candidates(boxes, np.full(len(boxes), scores), np.full(len(boxes), class_id, np.int64))


def nothing(crops):
    return [Candidates(np.empty((0, 4)), np.empty(0), np.empty(0, np.int64)) for _ in crops]


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
    again = look_again(picture(true), seen(first, 0.6), FIRST_SCALE, bright)
    boxes, scores = again.xyxy, again.scores
    scale = max(1.7 * width / CROP_PX[0], 1.7 * height / CROP_PX[1], 0.3)
    # Of the first look's error its share stays, and a pixel or so of the crop.
    stays = scale**2 / (scale**2 + FIRST_SCALE**2)
    np.testing.assert_allclose(boxes[0], true, atol=stays * np.abs(off).max() * max(width, height) + 2.0 * scale)
    assert scores[0] == pytest.approx(0.5 * 0.6 + 0.5 * 0.9)


def test_the_look_with_the_finer_pixels_counts_more():
    box = np.array([100.0, 100, 160, 160])
    own = Window.about(box, SIZE).scale
    coarse, alike, fine = (
        look_again(picture(box + 5.0), seen(box), scale, bright).xyxy[0] for scale in (1e4 * own, own, 1e-4 * own)
    )
    np.testing.assert_allclose(fine, box, atol=1e-3)
    np.testing.assert_allclose(coarse, box + 5.0, atol=2.0 * own)
    np.testing.assert_allclose(alike, 0.5 * (fine + coarse), atol=1e-3)


def test_a_thing_that_the_second_look_does_not_find_loses_half_its_score():
    box = np.array([[100.0, 100, 160, 160]])
    again = look_again(picture(box[0]), seen(box), FIRST_SCALE, nothing)
    np.testing.assert_array_equal(again.xyxy, box)
    assert again.scores.tolist() == [0.4]


def test_another_class_or_place_is_not_the_same_thing():
    box = np.array([[100.0, 100, 160, 160]])
    other_class = look_again(picture(box[0]), seen(box, class_id=1), FIRST_SCALE, bright)
    assert other_class.scores.tolist() == [0.4]
    elsewhere = look_again(picture((100, 100, 160, 160)), seen(box + 25.0), FIRST_SCALE, bright)
    assert elsewhere.scores.tolist() == [0.4]


def test_looks_are_bounded_and_the_rest_stays():
    shapes: list[tuple[int, ...]] = []

    def count(crops):
        shapes.extend(crop.shape for crop in crops)
        return nothing(crops)

    boxes = np.tile([[10.0, 10, 50, 50]], (9, 1)) + 45.0 * np.arange(9)[:, None]
    scores = look_again(picture((0, 0, 4, 4)), seen(boxes), FIRST_SCALE, count).scores
    assert shapes == [(CROP_PX[1], CROP_PX[0], 3)] * MOST_LOOKS
    assert scores.tolist() == [0.4] * MOST_LOOKS + [0.8] * (9 - MOST_LOOKS)


@pytest.mark.parametrize("box", [(-0.5, -0.5, 40, 40), (600, 440, 639.5, 479.5), (-0.5, -0.5, 639.5, 479.5)])
def test_boxes_at_the_border_and_of_the_whole_image_can_be_looked_at(box):
    assert np.isfinite(look_again(picture(box), seen(box), FIRST_SCALE, bright).xyxy).all()


def test_landmarks_get_finer_as_their_box_does():
    box = np.array([[100.0, 100, 160, 160]])
    points = np.array([[[110.0, 120], [150, 120]]])
    first = Candidates(box + 4.0, np.array([0.8]), np.array([0]), points + 4.0)

    def with_points(crops):
        found = bright(crops)
        window = Window.about(first.xyxy[0], SIZE)
        there = (points + 0.5 - [window.x, window.y]) / window.scale
        return [Candidates(found[0].xyxy, found[0].scores, found[0].class_ids, there)]

    again = look_again(picture(box[0]), first, FIRST_SCALE, with_points)
    assert again.landmarks is not None
    share = FIRST_SCALE**2 / (FIRST_SCALE**2 + Window.about(first.xyxy[0], SIZE).scale ** 2)
    np.testing.assert_allclose(again.landmarks, points + 4.0 * (1.0 - share), atol=1e-9)


def test_crops_go_through_the_model_at_once_or_one_by_one_alike(tmp_path):
    model = onnx.load(str(SHIPPED_MODEL))
    for value in (*model.graph.input, *model.graph.output):
        value.type.tensor_type.shape.dim[0].dim_value = 1
    alone = tmp_path / "alone.onnx"
    onnx.save(model, str(alone))
    image = np.asarray(cv2.imread(str(Path(__file__).parents[3] / "docs" / "images" / "cube_left.jpg")))
    twice = np.concatenate([image, np.roll(image, 100, axis=1)])
    found = [Detector(DetectorParameters(model=path, threshold=0.3)).detect(twice) for path in ("", str(alone))]
    assert len(found[0]) >= 2
    np.testing.assert_allclose(found[0].xyxy_px, found[1].xyxy_px, atol=0.01)
    np.testing.assert_allclose(found[0].scores, found[1].scores, atol=1e-3)
