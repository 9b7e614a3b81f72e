"""The zero-disparity filter on layered scenes cut from larger textures."""

import math

import cv2
import numpy as np
import pytest

from vergence_metric.tracking.zero_disparity import zero_disparity


def texture(seed):
    rng = np.random.default_rng(seed)
    fine = cv2.GaussianBlur(rng.standard_normal((480, 960)).astype(np.float32), (0, 0), 1.8)
    return np.clip(128 + 40 * fine / fine.std(), 0, 255)


def scene(box, target_px, wall_px, gain=1.0, noise=0.0):
    """A board that fills `box` (x0, y0, x1, y1) before a wall; whole disparities."""
    x0, y0, x1, y1 = box
    wall, target = texture(1), texture(2)
    left, right = wall[:, 160:800].copy(), wall[:, 160 + wall_px : 800 + wall_px].copy()
    left[y0:y1, x0:x1] = target[y0:y1, x0:x1]
    right[y0:y1, x0 - target_px : x1 - target_px] = target[y0:y1, x0:x1]
    rng = np.random.default_rng(3)
    images = [left, 110 + gain * (right - 110)]
    seen = [np.clip(i + rng.normal(0, noise, i.shape), 0, 255).astype(np.uint8) for i in images]
    return seen[0], seen[1]


@pytest.mark.parametrize("box", [(312, 232, 328, 248), (300, 222, 345, 262), (262, 190, 370, 285)])
@pytest.mark.parametrize(("target_px", "wall_px"), [(0, -8), (0, 7), (0, -40)])
def test_the_target_at_the_horopter_is_outlined(box, target_px, wall_px):
    region = zero_disparity(*scene(box, target_px, wall_px, gain=1.2, noise=3.0))
    assert region.found
    assert region.centroid_px == pytest.approx(((box[0] + box[2] - 1) / 2, (box[1] + box[3] - 1) / 2), abs=5.0)
    assert region.extent_px == pytest.approx((box[2] - box[0], box[3] - box[1]), abs=7)
    assert region.features > 0
    assert not region.touches_border


def test_any_disparity_may_be_asked_for_at_any_point():
    box = (420, 100, 460, 140)
    left, right = scene(box, 37, 5)
    region = zero_disparity(left, right, center_px=(441.0, 118.0), disparity_px=(37.2, 0.3))
    assert region.centroid_px == pytest.approx((439.5, 119.5), abs=3.0)
    inside = region.mask[box[1] - region.origin_px[1] :, box[0] - region.origin_px[0] :][:40, :40]
    assert inside.mean() > 0.75


def test_nothing_lies_where_nothing_is():
    left, right = scene((300, 222, 345, 262), 0, -8)
    region = zero_disparity(left, right, disparity_px=(25.0, 0.0))
    assert not region.found
    assert math.isnan(region.centroid_px[0])
    assert not region.mask.any()


def test_a_region_out_of_reach_is_not_taken():
    left, right = scene((380, 222, 420, 262), 0, -8)
    assert not zero_disparity(left, right, reach_px=20.0).found
    assert zero_disparity(left, right, reach_px=80.0).found


def test_a_wall_at_the_horopter_reaches_the_border():
    wall = texture(4)[:, :640].astype(np.uint8)
    region = zero_disparity(wall, wall.copy())
    assert region.touches_border


def test_a_blank_wall_has_no_features():
    blank = np.full((480, 640), 100, np.uint8)
    assert not zero_disparity(blank, blank).found
