"""The detector's training, without torch: labels and pictures agree, figures follow their definitions."""

import numpy as np
import pytest
from numpy.typing import NDArray

from training.augmentation import Strength, part_of, second_look_crop
from training.average_precision import ImageResult, average_precision, iou_matrix, mean_average_precision
from training.evaluation import Scores
from training.head_views import head_views
from training.labels import label
from training.look_alikes import KINDS, SMALLEST_PX, faces
from vergence_metric.boxes import Detector
from vergence_metric.boxes.parameters import DetectorParameters

FOCAL_PX = 500.0
SHAPE = (480, 640)
PLAIN = Strength(colour=0.0)


def square(x_m: float, depth_m: float, half_m: float) -> NDArray[np.float64]:
    """Corners of a flat square, facing the camera."""
    signs = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]] * 2)
    return np.column_stack([x_m + half_m * signs[:, 0], half_m * signs[:, 1], np.full(8, -depth_m)])


def seen_box(x_min: float, x_max: float) -> NDArray[np.bool_]:
    seen = np.zeros(SHAPE, bool)
    seen[190:290, max(int(x_min), 0) : max(int(x_max), 0)] = True
    return seen


class TestLabel:
    def test_what_is_seen_whole_has_its_outline(self) -> None:
        found = label(square(0.0, 1.0, 0.1), seen_box(270, 370), FOCAL_PX)
        assert found is not None
        assert found.box_px == pytest.approx([269.5, 189.5, 369.5, 289.5])
        assert found.share == pytest.approx(1.0, abs=0.03)
        assert not found.cut

    def test_what_is_half_hidden_has_the_box_of_what_is_seen(self) -> None:
        found = label(square(0.0, 1.0, 0.1), seen_box(270, 320), FOCAL_PX)
        assert found is not None
        assert found.box_px == pytest.approx([269.5, 189.5, 319.5, 289.5])
        assert found.share == pytest.approx(0.5, abs=0.03)

    def test_what_lies_beyond_the_border_is_unseen(self) -> None:
        found = label(square(-0.64, 1.0, 0.1), seen_box(-50, 50), FOCAL_PX)
        assert found is not None
        assert found.cut
        assert found.box_px[0] == -0.5
        assert found.share == pytest.approx(0.5, abs=0.03)

    def test_nothing_is_said_of_what_is_behind_or_out_of_view(self) -> None:
        assert label(square(0.0, 0.01, 0.1), seen_box(0, 640), FOCAL_PX) is None
        assert label(square(3.0, 1.0, 0.1), seen_box(0, 0), FOCAL_PX) is None


class TestPartOf:
    @pytest.mark.parametrize("seed", range(40))
    def test_boxes_follow_the_picture(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        image = np.full((*SHAPE, 3), 40, np.uint8)
        x, y = rng.integers(20, 500), rng.integers(20, 380)
        width, height = rng.integers(16, 120, 2)
        image[y : y + height, x : x + width] = 220
        boxes = np.array([[x, y, x + width, y + height]], np.float32)
        picture, found = part_of(rng, image, boxes, np.zeros((0, 2), np.float32), (192, 144), PLAIN)
        assert picture.shape == (144, 192, 3)
        bright = picture[:, :, 0] > 130
        if len(found):
            rows, columns = np.flatnonzero(bright.any(1)), np.flatnonzero(bright.any(0))
            drawn = [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]
            assert found[0] == pytest.approx(drawn, abs=0.76)

    def test_nothing_is_left_of_what_is_outside(self) -> None:
        boxes = np.array([[0, 0, 30, 30]], np.float32)
        rng, image = np.random.default_rng(0), np.zeros((*SHAPE, 3), np.uint8)
        for _ in range(30):
            _, found = part_of(rng, image, boxes, np.zeros((0, 2), np.float32), (192, 144), PLAIN)
            assert len(found) <= 1
            assert ((found >= 0) & (found <= [192, 144, 192, 144])).all()
            assert ((found[:, 2:] - found[:, :2]).min(initial=np.inf)) >= 5


def result(found: list[list[float]], scores: list[float], truth: list[list[float]], ignored: list[bool]) -> ImageResult:
    return ImageResult(
        np.array(found, float).reshape(-1, 4),
        np.array(scores),
        np.array(truth, float).reshape(-1, 4),
        np.array(ignored, bool),
    )


class TestAveragePrecision:
    HERE, FAR = [0.0, 0.0, 10.0, 10.0], [100.0, 100.0, 110.0, 110.0]

    def test_all_found_and_nothing_else_is_one(self) -> None:
        assert average_precision([result([self.HERE], [0.9], [self.HERE], [False])], 0.5) == 1.0

    def test_a_better_scored_mistake_halves_it(self) -> None:
        assert average_precision([result([self.HERE, self.FAR], [0.5, 0.9], [self.HERE], [False])], 0.5) == 0.5

    def test_a_worse_scored_mistake_costs_nothing(self) -> None:
        assert average_precision([result([self.HERE, self.FAR], [0.9, 0.5], [self.HERE], [False])], 0.5) == 1.0

    def test_a_second_box_on_the_same_object_is_a_mistake(self) -> None:
        twice = result([self.HERE, self.HERE], [0.9, 0.8], [self.HERE, self.FAR], [False, False])
        assert average_precision([twice], 0.5) == 0.5

    def test_ignored_objects_neither_help_nor_harm(self) -> None:
        both = result([self.HERE, self.FAR], [0.5, 0.9], [self.HERE, self.FAR], [False, True])
        assert average_precision([both], 0.5) == 1.0

    def test_overlaps_up_to_the_boxes_own_count(self) -> None:
        # 10x10 against 10x8: overlap 0.8, so that it passes at 0.5 to 0.8, seven of ten.
        near = result([[0.0, 0.0, 10.0, 8.0]], [0.9], [self.HERE], [False])
        assert mean_average_precision([near]) == pytest.approx(0.7)


FALSE = {"0.3": 40.0, "0.4": 5.0, "0.5": 0.0}


def test_the_shipped_threshold_is_the_lowest_with_few_enough_mistakes() -> None:
    assert Scores(10, 0.9, 0.8, 0.7, FALSE, {"0.3": 1.0, "0.4": 0.97, "0.5": 0.96}).threshold == 0.4


def test_the_shipped_threshold_is_lower_where_that_would_miss_too_many_cubes() -> None:
    assert Scores(10, 0.9, 0.8, 0.7, FALSE, {"0.3": 0.96, "0.4": 0.89, "0.5": 0.8}).threshold == 0.3


@pytest.mark.parametrize("kind", KINDS)
def test_every_look_alike_has_six_faces_and_a_size(kind: str) -> None:
    made = faces(np.random.default_rng(1), kind)
    assert len(made) == 6
    assert all(face.dtype == np.uint8 and face.std() >= 1 for face in made)
    assert SMALLEST_PX[kind] >= 6.5


class TestSecondLookCrop:
    @pytest.mark.parametrize("seed", range(40))
    def test_boxes_follow_the_picture(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        image = np.full((*SHAPE, 3), 40, np.uint8)
        low = rng.uniform((20, 20), (420, 260))
        box = np.rint(np.concatenate([low, low + rng.uniform(16, 140, 2)])).astype(np.float32)
        image[int(box[1]) : int(box[3]), int(box[0]) : int(box[2])] = 255
        alikes = np.array([[500, 380, 560, 440]], np.float32)
        picture, found = second_look_crop(rng, image, box[None], alikes, (96, 96), PLAIN)
        assert picture.shape == (96, 96, 3)
        bright = picture[..., 0] > 147
        if not len(found):
            assert bright.mean() < 0.6
            return
        rows, columns = np.flatnonzero(bright.any(1)), np.flatnonzero(bright.any(0))
        seen = [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]
        np.testing.assert_allclose(found[0], seen, atol=1.5)

    def test_objects_and_look_alikes_are_cropped_equally_often(self) -> None:
        rng, image = np.random.default_rng(0), np.zeros((*SHAPE, 3), np.uint8)
        box, alike = np.array([[40, 40, 100, 100]], np.float32), np.array([[400, 300, 460, 360]], np.float32)
        looks = [second_look_crop(rng, image, box, alike, (96, 96), PLAIN)[1] for _ in range(400)]
        assert 0.4 < np.mean([len(found) > 0 for found in looks]) < 0.6

    def test_an_empty_render_can_be_looked_at(self) -> None:
        nothing = np.empty((0, 4), np.float32)
        rng, image = np.random.default_rng(0), np.zeros((*SHAPE, 3), np.uint8)
        picture, found = second_look_crop(rng, image, nothing, nothing, (96, 96), Strength())
        assert picture.shape == (96, 96, 3)
        assert not len(found)


@pytest.mark.usefixtures("opengl")
def test_head_views_hold_the_cube_where_their_boxes_say() -> None:
    views = list(head_views(39_999, 6))
    assert len(views) == 6
    detector = Detector(DetectorParameters(threshold=0.3))
    overlaps = [
        iou_matrix(detector.detect(view.image).xyxy_px, view.boxes_px).max(initial=0.0)
        for view in views
        if len(view.boxes_px)
    ]
    assert len(overlaps) >= 3
    assert np.median(overlaps) > 0.8


@pytest.mark.usefixtures("opengl")
def test_head_views_are_their_seeds() -> None:
    for first, second in zip(head_views(39_999, 2), head_views(39_999, 2), strict=True):
        np.testing.assert_array_equal(first.image, second.image)
        np.testing.assert_array_equal(first.boxes_px, second.boxes_px)
