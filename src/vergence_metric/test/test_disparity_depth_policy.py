"""Whose disparity counts when three depths are in view."""

import cv2
import numpy as np
import pytest

from vergence_metric.disparity import DisparityStatus, make_estimator
from vergence_metric.disparity.parameters import DisparityParameters

NEAR, MIDDLE, FAR = 60, 34, 10
NEAR_BOX, MIDDLE_BOX = (360, 190, 410, 250), (240, 180, 345, 300)


def texture(seed):
    rng = np.random.default_rng(seed)
    fine = cv2.GaussianBlur(rng.standard_normal((480, 960)).astype(np.float32), (0, 0), 2.0)
    return np.clip(128 + 45 * fine / fine.std(), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def scene():
    """A far wall, a wide middle board at the centre, a small near one right of it; whole shifts, cut from more."""
    far, middle, near = texture(1), texture(2), texture(3)
    left, right = far[:, 160:800].copy(), far[:, 160 + FAR : 800 + FAR].copy()
    for surface, (x0, y0, x1, y1), d in ((middle, MIDDLE_BOX, MIDDLE), (near, NEAR_BOX, NEAR)):
        left[y0:y1, x0:x1] = surface[y0:y1, x0:x1]
        right[y0:y1, x0 - d : x1 - d] = surface[y0:y1, x0:x1]
    return left, right


def inside(point, box):
    return box[0] <= point[0] < box[2] and box[1] <= point[1] < box[3]


@pytest.mark.parametrize(
    ("changes", "disparity_px", "box"),
    [
        ({}, MIDDLE, MIDDLE_BOX),
        ({"depth_policy": "nearest"}, NEAR, NEAR_BOX),
        ({"depth_policy": "largest"}, FAR, (0, 0, 640, 480)),
        ({"depth_policy": "box", "box_px": (355.0, 185.0, 415.0, 255.0)}, NEAR, NEAR_BOX),
        ({"depth_policy": "box", "box_px": (60.0, 60.0, 160.0, 160.0)}, FAR, (60, 60, 161, 161)),
    ],
)
def test_the_policy_picks_the_layer(scene, changes, disparity_px, box):
    answer = make_estimator(DisparityParameters(**changes)).estimate(*scene)
    assert answer.ok
    assert answer.horizontal_px == pytest.approx(disparity_px, abs=0.1)
    assert inside(answer.point_px, box)


def test_a_blank_area_is_not_given_a_layer():
    blank = np.full((480, 640), 120, np.uint8)
    answer = make_estimator(DisparityParameters(depth_policy="nearest")).estimate(blank, blank)
    assert answer.status is DisparityStatus.NO_TEXTURE
    assert answer.confidence == 0.0


def test_a_layer_too_small_for_the_policy_is_not_answered_surely(scene):
    box = (239.0, 179.0, 246.0, 186.0)
    answer = make_estimator(DisparityParameters(depth_policy="box", box_px=box)).estimate(*scene)
    assert answer.status is DisparityStatus.AMBIGUOUS
    assert answer.confidence <= 0.5
    assert "box" in answer.reason
