"""Semi-global matching about a point: small things, depth edges, eyes that differ, repetition, and what it states."""

import math

import cv2
import numpy as np
import pytest

from vergence_metric.disparity import DisparityStatus, make_estimator
from vergence_metric.disparity.candidates import column, profiles, repetitions, vertical_px
from vergence_metric.disparity.lighting import lit_alike
from vergence_metric.disparity.own_surface import own_surface
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.search import pair_about
from vergence_metric.disparity.semi_global_model import (
    CHOICE,
    CONFIDENCE,
    SIGMA,
    Evidence,
    Support,
    choice_score,
    confidence,
    sigma_px,
)
from vergence_metric.disparity.strip_matching import DisparityPatch, coarse, fine, returned

WIDTH, HEIGHT = 640, 480
POINT = (320.0, 240.0)
PARAMETERS = DisparityParameters(estimator="semi_global")


def texture(seed, size=1700):
    rng = np.random.default_rng(seed)
    out = np.zeros((size, size), np.float32)
    for sigma in (3.0, 6.0, 12.0, 24.0):
        out += cv2.GaussianBlur(rng.standard_normal((size, size)).astype(np.float32), (0, 0), sigma) * sigma
    return 128 + 45 * (out - out.mean()) / out.std()


def view(surface, shift_px=0.0, vertical_px=0.0, slope=(0.0, 0.0), noise_seed=None):
    """See a twice oversampled surface; `slope` is the disparity's change per pixel across and down from the point."""
    x, y = np.meshgrid(np.arange(WIDTH) - POINT[0], np.arange(HEIGHT) - POINT[1])
    middle = (surface.shape[0] - 1) / 2
    # The right pixel x shows the left one x + d(x, y); solved for the left one.
    u = (x + shift_px + slope[1] * y) / (1.0 - slope[0])
    grey = cv2.remap(
        surface,
        (middle + 2 * u).astype(np.float32),
        (middle + 2 * (y + vertical_px)).astype(np.float32),
        cv2.INTER_LINEAR,
    )
    if noise_seed is not None:
        grey = grey + np.random.default_rng(noise_seed).normal(0.0, 2.0, grey.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def bar(width_px, near_px, far_px, seed=0):
    """See a bar of this width about the point before a textured background; both have a texture of their own."""
    far, near = texture(20 + seed), texture(50 + seed)
    left, right = view(far, noise_seed=1), view(far, far_px, noise_seed=2)
    first = round(POINT[0]) - width_px // 2
    left[:, first : first + width_px] = view(near, noise_seed=3)[:, first : first + width_px]
    seen = slice(first - near_px, first - near_px + width_px)
    right[:, seen] = view(near, near_px, noise_seed=4)[:, seen]
    return left, right


def estimate(left, right, point=POINT, expected_px=None, **changes):
    estimator = make_estimator(PARAMETERS.replaced(**changes) if changes else PARAMETERS)
    return estimator.estimate(left, right, point, expected_px)


@pytest.fixture(scope="module")
def plain():
    return texture(1)


@pytest.mark.parametrize(("width_px", "near_px"), [(9, 12), (12, 25), (12, 40), (15, 70)])
def test_a_narrow_bar_before_texture_has_its_own_disparity(width_px, near_px):
    left, right = bar(width_px, near_px, 0)
    answer = estimate(left, right)
    assert answer.ok
    assert answer.horizontal_px == pytest.approx(near_px, abs=0.5)
    behind = estimate(left, right, (POINT[0] + 60, POINT[1]))
    assert behind.horizontal_px == pytest.approx(0.0, abs=0.1)


def test_sigma_and_confidence_say_that_a_depth_edge_is_near(plain):
    near_edge, alone = estimate(*bar(9, 12, 0)), estimate(view(plain), view(plain, 12.0))
    assert near_edge.sigma_px > 2.0 * alone.sigma_px
    assert near_edge.confidence < alone.confidence


@pytest.mark.parametrize("vertical", [-4.0, 2.0, 5.0])
def test_rows_may_be_off(plain, vertical):
    answer = estimate(view(plain), view(plain, 31.4, vertical))
    assert answer.ok
    assert answer.horizontal_px == pytest.approx(31.4, abs=0.05)
    assert answer.vertical_px == pytest.approx(vertical, abs=0.05)


@pytest.mark.parametrize(("gain", "offset"), [(0.6, 40.0), (1.4, -40.0)])
def test_eyes_may_be_lit_differently(gain, offset):
    left, right = bar(15, 25, 0)
    right = np.clip(gain * right + offset, 0, 255).astype(np.uint8)
    assert estimate(left, right).horizontal_px == pytest.approx(25.0, abs=0.5)


def test_a_steep_surface_is_measured_to_a_fraction_of_a_pixel(plain):
    answer = estimate(view(plain), view(plain, 20.3, slope=(0.1, -0.05)))
    assert answer.ok
    assert answer.horizontal_px == pytest.approx(20.3, abs=0.05)


def test_an_expectation_is_searched_first_and_no_more_than_that(plain):
    left, right = view(plain), view(plain, 22.0)
    for expected_px in (20.0, 25.5, -100.0, 500.0):
        answer = estimate(left, right, expected_px=expected_px)
        assert answer.ok
        assert answer.horizontal_px == pytest.approx(22.0, abs=0.05)


def test_candidates_are_ranked_begin_with_the_answer_and_hold_what_lies_beside_it():
    left, right = bar(11, 12, 0)
    answer = estimate(left, right)
    likelihoods = [one.likelihood for one in answer.candidates]
    assert likelihoods == sorted(likelihoods, reverse=True)
    assert sum(likelihoods) < 1.0
    assert answer.candidates[0].disparity_px == pytest.approx(answer.horizontal_px, abs=1.0)
    assert any(abs(one.disparity_px) < 1.0 for one in answer.candidates[1:])
    assert all(one.found_by for one in answer.candidates)


def board(period_px, shift):
    x, y = np.arange(WIDTH + 300), np.arange(HEIGHT)[:, None]
    grey = (128 + 60 * np.sin(2 * np.pi * x / period_px) * np.sin(2 * np.pi * y / 29.0)).astype(np.uint8)
    return grey[:, 150 : 150 + WIDTH], grey[:, 150 + shift : 150 + shift + WIDTH]


@pytest.mark.parametrize("expected_px", [None, 7.0, 40.0])
def test_a_repeated_texture_is_ambiguous_and_its_periods_are_candidates(expected_px):
    left, right = board(33.0, 7)
    answer = estimate(left, right, expected_px=expected_px)
    assert answer.status is DisparityStatus.AMBIGUOUS
    assert answer.confidence <= 0.5
    assert math.isfinite(answer.horizontal_px)
    found = {round(one.disparity_px) for one in answer.candidates}
    assert len([d for d in found if min(abs(d - 7 - 33 * k) for k in range(-5, 6)) <= 1]) >= 3


def test_only_what_repeats_itself_is_a_repetition():
    left, right = bar(9, 12, 0)
    pair = pair_about(left, right, POINT, PARAMETERS)
    assert repetitions(pair, 12.0, profiles(pair, PARAMETERS), PARAMETERS) == []
    left, right = board(33.0, 7)
    pair = pair_about(left, right, POINT, PARAMETERS)
    rivals = repetitions(pair, 7.0, profiles(pair, PARAMETERS), PARAMETERS)
    assert {round((r - 7.0) / 33.0) for r in rivals} >= {-2, -1, 1, 2}


def test_a_point_that_the_right_eye_does_not_see_is_not_answered_surely(plain):
    left, right = view(plain), view(plain)
    right[:, 290:350] = view(texture(3))[:, 290:350]
    answer = estimate(left, right)
    assert answer.confidence <= 0.5
    assert not answer.ok
    assert answer.reason


@pytest.mark.parametrize("point", [(0.0, 0.0), (WIDTH - 1.0, HEIGHT - 1.0), (3.0, 470.0)])
def test_the_images_rim_is_no_error(plain, point):
    answer = estimate(view(plain), view(plain, 5.0), point)
    assert not answer.ok or answer.horizontal_px == pytest.approx(5.0, abs=0.5)


def test_small_images_and_a_small_range():
    rng = np.random.default_rng(0)
    left = cv2.GaussianBlur(rng.integers(0, 255, (40, 60), np.uint8), (0, 0), 1.0)
    answer = estimate(left, np.roll(left, -3, axis=1), (30.0, 20.0), max_px=8, max_vertical_px=0, windows_px=(5.0,))
    assert not answer.ok or answer.horizontal_px == pytest.approx(3.0, abs=0.5)


@pytest.mark.parametrize("shift", [-120, 0, 37])
def test_strips_find_a_shift_coarsely_finely_and_back(plain, shift):
    left, right = view(plain, vertical_px=0.0), view(plain, float(shift), 2.0)
    assert coarse(left, right, POINT, 2, 160).at(*POINT) == pytest.approx(shift, abs=1.0)
    patch = fine(left, right, POINT, 2, (shift - 9, shift + 14))
    assert patch.at(*POINT) == pytest.approx(shift, abs=0.5)
    assert np.median(patch.about(*POINT, 20)) == pytest.approx(shift, abs=0.2)
    back = returned(left, right, (POINT[0] - shift, POINT[1] - 2), 2, (shift - 9, shift + 14))
    assert back == pytest.approx(shift, abs=0.5)


def test_a_patch_is_unknown_outside():
    patch = DisparityPatch(np.zeros((4, 6), np.float32), 10, 20)
    assert patch.at(15, 23) == 0.0
    assert all(math.isnan(patch.at(*at)) for at in ((9, 20), (16, 20), (10, 24)))
    assert patch.about(10, 20, 1).size == 4


def test_a_surface_is_a_plane_and_ends_where_another_begins():
    v, u = np.mgrid[-20:21, -30:31]
    plane = (40.0 + 0.05 * u - 0.1 * v).astype(np.float32)
    plane[:, 40:] = 12.0
    plane[3, 7] = np.nan
    own = own_surface(DisparityPatch(plane, 70, 80), (100, 100), 40.4, 35)
    assert (own.disparity_px, own.slope_x, own.slope_y) == pytest.approx((40.0, 0.05, -0.1), abs=0.01)
    assert own.support.grey.shape == (71, 71)
    assert own.support.grey[35, 35:45].all()
    assert not own.support.grey[35, 45:].any()
    assert own.share(8) == pytest.approx(1.0)
    alone = own_surface(DisparityPatch(plane, 70, 80), (100, 100), 90.0, 35)
    assert (alone.disparity_px, alone.slope_x) == (90.0, 0.0)
    assert alone.share(8) == 0.0


def test_vertical_disparity_is_that_of_the_surroundings(plain):
    for vertical in (-4.0, 0.0, 2.0):
        pair = pair_about(view(plain), view(plain, 12.0, vertical), POINT, PARAMETERS)
        assert vertical_px(profiles(pair, PARAMETERS)) == vertical


def test_the_right_image_is_lit_as_the_left_one_in_the_rows_that_are_matched(plain):
    left, right = view(plain), view(plain, 12.0)
    dark = np.clip(0.6 * right + 30, 0, 255).astype(np.uint8)
    pair = pair_about(left, dark, POINT, PARAMETERS)
    alike = lit_alike(pair, profiles(pair, PARAMETERS), 40)
    assert np.abs(alike[200:281].astype(float) - right[200:281])[:, 260:360].mean() < 2.0
    assert (alike[:199] == dark[:199]).all()
    assert pair.right is dark


EVIDENCE = Evidence(
    score=2.0,
    back_px=0.1,
    own_share=0.9,
    fit_sigma_px=0.05,
    fit_correlation=0.99,
    off_plane_px=0.05,
)


@pytest.mark.parametrize(
    "worse",
    [
        {"score": -1.0},
        {"back_px": 9.0},
        {"back_px": math.nan},
        {"own_share": 0.2},
        {"fit_correlation": 0.3},
        {"off_plane_px": 0.8},
        {"fit_sigma_px": math.nan, "off_plane_px": math.nan},
    ],
)
def test_worse_evidence_lowers_the_confidence(worse):
    changed = Evidence(**(EVIDENCE.__dict__ | worse))
    assert 0.0 < confidence(changed) < confidence(EVIDENCE) < 1.0


def test_the_deviation_grows_with_the_fits_and_with_its_distance_from_the_surface():
    assert sigma_px(EVIDENCE) < sigma_px(Evidence(**(EVIDENCE.__dict__ | {"fit_sigma_px": 0.2})))
    assert sigma_px(EVIDENCE) < sigma_px(Evidence(**(EVIDENCE.__dict__ | {"off_plane_px": 0.5})))
    assert 0.01 < sigma_px(EVIDENCE) < 0.5
    assert len(SIGMA) == 1 + len(EVIDENCE.scales)
    assert len(CONFIDENCE) == 1 + len(EVIDENCE.terms)


def test_more_support_makes_a_candidate_likelier():
    support = Support(agrees=0.0, near_share=0.2, column=0.3)
    for name in support.__dict__:
        assert choice_score(Support(**(support.__dict__ | {name: 0.9}))) > choice_score(support)
    assert len(CHOICE) == 1 + len(support.__dict__)


def rod(width_px, near_px, far_px, seed):
    """See an upright rod with bands along it, alike across, before a textured background."""
    left, right = view(texture(20 + seed), noise_seed=1), view(texture(20 + seed), far_px, noise_seed=2)
    bands = cv2.GaussianBlur(np.random.default_rng(seed).normal(0.0, 1.0, (HEIGHT, 1)), (0, 0), 2.0)
    grey = np.clip(90.0 + 40.0 * bands / bands.std(), 0, 255).astype(np.uint8)
    first = round(POINT[0]) - width_px // 2
    left[:, first : first + width_px] = grey
    right[:, first - near_px : first - near_px + width_px] = grey
    return left, right


@pytest.mark.parametrize(("width_px", "most_wrong"), [(7, 2), (9, 0)])
def test_a_thin_rod_is_matched_by_its_own_pixels(width_px, most_wrong):
    answers = [estimate(*rod(width_px, 40, 0, seed)) for seed in range(6)]
    wrong = [answer for answer in answers if not (answer.ok and abs(answer.horizontal_px - 40.0) <= 2.0)]
    assert len(wrong) <= most_wrong


def test_the_tall_window_sees_the_rod_where_square_ones_see_the_background():
    left, right = rod(5, 40, 0, 3)
    pair = pair_about(left, right, POINT, PARAMETERS)
    tall, square = column(pair, 0, (-100, 100), PARAMETERS), profiles(pair, PARAMETERS)[2]
    assert tall.at(40.0) > 0.8 > tall.at(0.0)
    assert square.at(0.0) > square.at(40.0)


@pytest.mark.parametrize(("width_px", "seed"), [(4, 8), (4, 11), (5, 5), (5, 11)])
def test_where_the_strip_takes_a_rod_for_its_background_the_tall_window_decides_alone(width_px, seed):
    found = estimate(*rod(width_px, 40, 0, seed))
    assert found.ok
    assert found.horizontal_px == pytest.approx(40.0, abs=2.0)
    assert found.candidates[0].found_by == "tall window alone"


@pytest.mark.parametrize("seed", range(6))
def test_the_tall_window_does_not_decide_where_images_are_unrelated(seed):
    left, _ = rod(5, 40, 0, seed)
    found = estimate(left, view(texture(90 + seed), noise_seed=seed))
    assert not found.ok
    assert all(one.found_by != "tall window alone" for one in found.candidates)


def test_own_pixels_decide_where_they_fit_and_match_back():
    assert EVIDENCE.own_pixels_decide
    for worse in ({"fit_correlation": 0.5}, {"own_share": 0.05}, {"back_px": 8.0}, {"fit_sigma_px": math.nan}):
        assert not Evidence(**(EVIDENCE.__dict__ | worse)).own_pixels_decide
