"""The contrast that a pair would have at a distance, and what it says of distances that a repeated texture allows."""

import cv2
import numpy as np
import pytest

from vergence_metric.disparity.protocol import Candidate, Disparity, DisparityStatus
from vergence_metric.edges.verged_contrast import contrasts_if_verged
from vergence_metric.tracking.depth_evidence import parallax_shares
from vergence_metric.tracking.eye_view import EyeView
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.tracked_target import parallax
from vergence_rig.camera import CameraModel
from vergence_rig.rig import default_rig

AT, TRUE_PX, REPEATED_PX = (320.0, 240.0), 12, 36
CAMERA = CameraModel(default_rig().left_camera)


def fence(shift_px, seed=4):
    """Upright bars every 24 px, a little different each, as far to the left as given."""
    random = np.random.default_rng(seed)
    image = np.full((480, 900), 90, np.uint8)
    for first in range(0, 900, 24):
        top, bottom = (int(v) for v in random.integers(-9, 10, 2))
        cv2.line(image, (first + top, 0), (first + bottom, 479), int(random.integers(170, 230)), 7)
    noise = np.random.default_rng(shift_px).normal(0.0, 2.0, (480, 640))
    return np.clip(image[:, 100 + shift_px : 740 + shift_px] + noise, 0, 255).astype(np.uint8)


def pair_of(right):
    views = (EyeView(CAMERA, -0.02, 0.0), EyeView(CAMERA, 0.02, 0.0))
    return StoredPair(0.0, fence(0), right, views)


def at(disparity_px):
    return AT[0] - disparity_px, AT[1]


def test_it_is_low_where_the_point_is_and_about_one_elsewhere():
    left, right = fence(0), fence(TRUE_PX)
    there, elsewhere = contrasts_if_verged(left, right, AT, [at(TRUE_PX), at(TRUE_PX + 11.0)])
    assert there < 0.2
    assert elsewhere > 0.7


def test_without_edges_it_is_nan():
    flat = np.full((480, 640), 90, np.uint8)
    assert np.isnan(contrasts_if_verged(flat, flat, AT, [at(TRUE_PX)])).all()


def repeats(status):
    seen = (Candidate(REPEATED_PX, 0.5, "window"), Candidate(TRUE_PX, 0.49, "repeated texture"))
    return Disparity(REPEATED_PX, 0.0, 0.1, 0.5, status, "the texture repeats", "fake", AT, seen)


def test_of_repetitions_the_one_whose_edges_agree_is_the_likeliest():
    pair = pair_of(fence(TRUE_PX))
    shares = dict(parallax_shares(repeats(DisparityStatus.AMBIGUOUS), AT, pair))
    true, repeated = (shares[parallax(AT, pair.views, at(px))] for px in (TRUE_PX, REPEATED_PX))
    assert true > 3.0 * repeated
    assert true + repeated == pytest.approx(1.0, abs=0.05)


def test_equal_repetitions_stay_as_likely_as_each_other():
    left = np.tile(fence(0)[:1, :24], (480, 27))[:, :640].copy()
    pair = StoredPair(0.0, left, np.roll(left, -TRUE_PX, axis=1), pair_of(left).views)
    shares = dict(parallax_shares(repeats(DisparityStatus.AMBIGUOUS), AT, pair))
    true, repeated = (shares[parallax(AT, pair.views, at(px))] for px in (TRUE_PX, REPEATED_PX))
    assert true == pytest.approx(repeated, rel=0.1)


def test_an_answer_without_repetition_is_not_looked_at_again():
    pair = pair_of(fence(TRUE_PX))
    (first, share), *_ = parallax_shares(repeats(DisparityStatus.OK), AT, pair)
    assert first == parallax(AT, pair.views, at(REPEATED_PX))
    assert share == 0.5


def test_what_the_estimator_refuses_says_nothing():
    assert parallax_shares(repeats(DisparityStatus.NO_MATCH), AT, pair_of(fence(TRUE_PX))) == []
