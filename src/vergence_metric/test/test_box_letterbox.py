"""Images fitted into inputs, and boxes back: round trips and the family's own rounding."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.boxes.detections import cut_sides, make_detections
from vergence_metric.boxes.letterbox import RESIZES, Letterbox
from vergence_metric.boxes.preprocessing import Preprocessing
from vergence_metric.boxes.suppression import suppress

sides = st.integers(32, 2000)


@settings(deadline=None, max_examples=200)
@given(sides, sides, st.integers(1, 40), st.integers(1, 40), st.sampled_from(RESIZES), st.data())
def test_boxes_survive_the_round_trip(width, height, columns, rows, resize, data):
    box = Letterbox.fit((width, height), (columns * 32, rows * 32), resize)
    x = sorted(data.draw(st.tuples(st.floats(-0.5, width - 0.5), st.floats(-0.5, width - 0.5))))
    y = sorted(data.draw(st.tuples(st.floats(-0.5, height - 0.5), st.floats(-0.5, height - 0.5))))
    source = np.array([[x[0], y[0], x[1], y[1]]])
    there = box.to_input(source)
    assert (there >= -1e-6).all()
    assert (there <= np.array([columns * 32, rows * 32] * 2) + 1e-6).all()
    np.testing.assert_allclose(box.to_source(there), source, atol=1e-6)


@settings(deadline=None, max_examples=200)
@given(sides, sides)
def test_rounding_is_the_familys(width, height):
    """Left and top round(d/2 - 0.1), right and bottom round(d/2 + 0.1), as the family's own loaders write it."""
    size = 640
    ratio = min(size / height, size / width)
    fitted = round(width * ratio), round(height * ratio)
    rest = (size - fitted[0]) / 2, (size - fitted[1]) / 2
    box = Letterbox.fit((width, height), (size, size))
    assert box.fitted_px == fitted
    assert box.offset_px == (round(rest[0] - 0.1), round(rest[1] - 0.1))
    assert size - fitted[0] - box.offset_px[0] == round(rest[0] + 0.1)
    assert size - fitted[1] - box.offset_px[1] == round(rest[1] + 0.1)


def test_the_picture_lies_where_boxes_say():
    image = np.zeros((90, 120, 3), np.uint8)
    image[30:60, 40:80] = 255
    box = Letterbox.fit((120, 90), (64, 64))
    picture = box.place(image)
    assert picture.shape == (64, 64, 3)
    assert (picture[0] == 114).all()
    assert (picture[-1] == 114).all()
    expected = box.to_input(np.array([[39.5, 29.5, 79.5, 59.5]]))[0]
    rows, columns = np.nonzero((picture[:, :, 0] > 127) & (picture[:, :, 0] != 114))
    np.testing.assert_allclose([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1], expected, atol=0.75)


def test_halving_keeps_the_mean():
    """OpenCV's linear resize counts from the outer corner as the boxes here do: a half is a mean of four."""
    image = np.random.default_rng(1).integers(0, 255, (48, 64, 3)).astype(np.uint8)
    small = Letterbox.fit((64, 48), (32, 24)).place(image).astype(float)
    mean = image.reshape(24, 2, 32, 2, 3).mean((1, 3))
    assert np.abs(small - mean).max() <= 1.0


def test_the_tensor_is_planes_of_the_wanted_order():
    picture = np.zeros((4, 6, 3), np.uint8)
    picture[..., 2] = 255
    rgb = Preprocessing("rgb", True, "letterbox").tensor([picture], np.float32)
    assert rgb.shape == (1, 3, 4, 6)
    assert rgb[0, 0].min() == 1.0
    assert rgb[0, 1:].max() == 0.0
    bgr = Preprocessing("bgr", False, "letterbox").tensor([picture], np.float16)
    assert bgr.dtype == np.float16
    assert bgr[0, 2].min() == 255.0


def test_suppression_is_within_a_class():
    boxes = np.array([[0, 0, 10, 10], [1, 0, 11, 10], [1, 0, 11, 10], [30, 30, 40, 40]], float)
    scores, ids = np.array([0.9, 0.8, 0.7, 0.3]), np.array([0, 0, 1, 0])
    assert suppress(boxes, scores, ids, 0.5, 10).tolist() == [0, 2, 3]
    assert suppress(boxes, scores, ids, 0.9, 10).tolist() == [0, 1, 2, 3]
    assert suppress(boxes, scores, ids, 0.5, 2).tolist() == [0, 2]


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 30), st.integers(0, 2**32 - 1))
def test_suppression_leaves_no_overlap_and_loses_nothing_alone(count, seed):
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 80, (count, 2))
    boxes = np.hstack([low, low + rng.uniform(1, 40, (count, 2))])
    scores, ids = rng.uniform(0, 1, count), rng.integers(0, 2, count)
    kept = suppress(boxes, scores, ids, 0.4, 1000)
    assert len(set(kept.tolist())) == len(kept)

    def iou(a, b):
        w = min(a[2], b[2]) - max(a[0], b[0])
        h = min(a[3], b[3]) - max(a[1], b[1])
        shared = max(w, 0) * max(h, 0)
        return shared / ((a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - shared)

    for i in range(count):
        rivals = [k for k in kept if ids[k] == ids[i] and k != i and iou(boxes[i], boxes[k]) > 0.4]
        # Kept exactly if no kept better one of its class overlaps it.
        assert (i in kept) == all(scores[k] < scores[i] for k in rivals)


def test_cut_sides_and_clipping():
    found = make_detections(
        np.array([[-4.0, 10, 20, 30], [50, 50, 105.0, 85]]),
        np.array([0.5, 0.6]),
        np.array([0, 7]),
        ("cube",),
        (100, 80),
    )
    assert found.class_names == ("7", "cube")
    assert found.boxes()[0].cut == (False, False, True, True)
    assert found.boxes()[1].cut == (True, False, False, False)
    assert found.xyxy_px[1, 0] == -0.5
    assert found.xyxy_px[0, 2] == 99.5
    assert not cut_sides(np.array([[5.0, 5, 90, 70]]), (100, 80)).any()


def test_an_image_that_fits_is_not_copied():
    image = np.zeros((24, 32, 3), np.uint8)
    assert Letterbox.fit((32, 24), (32, 24)).place(image) is image
