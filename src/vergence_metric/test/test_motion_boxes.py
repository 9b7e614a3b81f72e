"""What moves before eyes at rest becomes an object of the class motion."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.follow_parameters import MotionParameters
from vergence_metric.boxes.motion import MOTION_CLASS, ChangeDetector, outside_of

PERIOD_S = 0.1
REST = (0.1, 0.0)
SIDE_PX = 80


def view(column, row=200, seed=1, light=1.0, noise=2.0):
    """A textured room with a textured square at a column and row, and sensor noise of its own."""
    room = cv2.resize(np.random.default_rng(5).uniform(60, 180, (24, 32)).astype(np.float32), (640, 480))
    square = cv2.resize(np.random.default_rng(6).uniform(20, 230, (6, 6)).astype(np.float32), (SIDE_PX, SIDE_PX))
    if column is not None:
        room[row : row + SIDE_PX, column : column + SIDE_PX] = square
    noisy = room * light + np.random.default_rng(seed).normal(0.0, noise, room.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def shown(images, poses=None, **parameters):
    """Return the boxes of the last image."""
    detector, boxes = ChangeDetector(MotionParameters(**parameters)), []
    for i, image in enumerate(images):
        boxes = detector.detect(image, 10.0 + PERIOD_S * i, REST if poses is None else poses[i])
    return boxes


def test_what_moves_has_a_box_around_it():
    (box,) = shown([view(200 + 12 * i, seed=i) for i in range(4)])
    assert box.class_name == MOTION_CLASS
    assert box.center_px[0] == pytest.approx(236 + SIDE_PX / 2, abs=40)
    assert box.center_px[1] == pytest.approx(200 + SIDE_PX / 2, abs=20)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10_000), st.floats(0.0, 4.0))
def test_noise_alone_is_no_motion(seed, noise):
    assert shown([view(200, seed=seed + i, noise=noise) for i in range(4)]) == []


def test_light_that_changes_everywhere_is_no_motion():
    assert shown([view(200, seed=i, light=1.0 + 0.15 * i) for i in range(3)]) == []


def test_eyes_that_turn_see_no_motion():
    moving = [view(200 + 12 * i, seed=i) for i in range(4)]
    assert shown(moving, [(0.1, 0.0), (0.1, 0.0), (0.1, 0.0), (0.12, 0.0)]) == []
    assert shown(moving, [(0.1, 0.0), (0.12, 0.0), (0.12, 0.0), (0.12, 0.0)])


def test_images_with_a_gap_between_them_are_not_compared():
    detector = ChangeDetector(MotionParameters())
    detector.detect(view(200), 10.0, REST)
    assert detector.detect(view(260), 12.0, REST) == []
    assert detector.detect(view(260), 11.0, REST) == []


def test_a_moving_thing_that_is_smaller_than_asked_for_is_left_out():
    moving = [view(200 + 12 * i, seed=i) for i in range(4)]
    assert shown(moving, min_share=0.2) == []


def test_a_detected_object_that_moves_is_not_found_twice():
    moving = Box((100.0, 100.0, 180.0, 180.0), 0.8, -2, MOTION_CLASS)
    face = Box((90.0, 90.0, 190.0, 190.0), 0.9, 0, "face")
    elsewhere = Box((300.0, 90.0, 400.0, 190.0), 0.9, 0, "face")
    assert outside_of([moving], [face]) == []
    assert outside_of([moving], [elsewhere]) == [moving]
