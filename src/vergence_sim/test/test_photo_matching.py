"""Matched disparities: right on a plane at any size, unsure at a depth edge."""

import cv2
import numpy as np
import pytest

from vergence_sim.photo.matching import matched_disparity


def textured(seed, height, width):
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, (height, width, 3)), (0, 0), 2)
    return np.clip(128 + 50 * noise / noise.std(), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("scale", [1, 3])
def test_a_plane_has_its_disparity(scale):
    left = cv2.resize(textured(0, 240, 400), None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    right = np.roll(left, -24 * scale, axis=1)
    found = matched_disparity(left, right)[40 * scale : 200 * scale, 130 * scale : 360 * scale]
    assert np.isfinite(found).mean() > 0.9
    assert np.nanmedian(found) == pytest.approx(24 * scale, abs=0.3 * scale)
    assert np.nanmax(np.abs(found - 24 * scale)) < 2 * scale


def test_near_a_depth_edge_nothing_is_sure():
    behind, front = textured(1, 240, 400), textured(2, 240, 400)
    left, right = behind.copy(), np.roll(behind, -8, axis=1)
    left[80:160, 200:300] = front[80:160, 200:300]
    right[80:160, 160:260] = front[80:160, 200:300]
    found = matched_disparity(left, right)
    assert found[120, 250] == pytest.approx(40, abs=0.5)
    assert found[40, 250] == pytest.approx(8, abs=0.5)
    assert np.isnan(found[100:140, 297:303]).all()
