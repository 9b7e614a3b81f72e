"""When eyes are called verged: what a pair shows, its own contrast, and how sure one pair can make."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_gaze.control.vergence_judge import VergenceJudge
from vergence_gaze.estimation.evidence import Gaussian, probability_beyond_limit
from vergence_gaze.verged_parameters import VergedParameters

LIMIT_RAD = 0.0155
WRONG_SHARE, WRONG_RANGE_RAD = 0.05, 0.5
SMALL_RAD = 0.001
SURE = 1e-4
GOOD, BAD = 0.4, 0.95
FRAME_S = 1.0 / 30.0


def judge(error_probability: float = VergedParameters().single_pair_error_probability) -> VergenceJudge:
    return VergenceJudge(VergedParameters(single_pair_error_probability=error_probability))


def test_one_certain_pair_with_its_own_contrast_suffices() -> None:
    judging = judge()
    judging.update_contrast(1.0, GOOD, 1.06)
    assert judging.update_pair(1.0, 1.06, SMALL_RAD, True, True, SURE)


def test_an_uncertain_pair_needs_a_second() -> None:
    judging = judge()
    for stamp_s, verged in ((1.0, False), (1.0 + FRAME_S, True)):
        judging.update_contrast(stamp_s, GOOD, stamp_s + 0.06)
        assert judging.update_pair(stamp_s, stamp_s + 0.06, SMALL_RAD, True, True, 0.05) is verged


def test_where_no_error_probability_is_allowed_every_pair_needs_a_second() -> None:
    judging = judge(error_probability=0.0)
    judging.update_contrast(1.0, GOOD, 1.06)
    assert not judging.update_pair(1.0, 1.06, SMALL_RAD, True, True, SURE)


def test_one_pair_does_not_suffice_by_the_contrast_of_the_pair_before() -> None:
    judging = judge()
    judging.update_contrast(1.0 - FRAME_S, GOOD, 1.03)
    assert not judging.update_pair(1.0, 1.06, SMALL_RAD, True, True, SURE)


@pytest.mark.parametrize(("contrast", "verged"), [(GOOD, True), (BAD, False)])
def test_a_pair_is_judged_again_by_its_own_contrast(contrast: float, verged: bool) -> None:
    judging = judge()
    judging.update_contrast(1.0 - FRAME_S, BAD, 1.03)  # exposed while the eyes were flying
    assert not judging.update_pair(1.0, 1.06, SMALL_RAD, True, True, SURE)
    judging.update_contrast(1.0, contrast, 1.07)
    assert judging.verged is verged


def test_a_second_measurement_of_a_pair_replaces_the_first() -> None:
    judging = judge()
    judging.update_contrast(1.0, GOOD, 1.06)
    judging.update_pair(1.0, 1.06, SMALL_RAD, True, True, 0.05)
    judging.update_pair(1.0, 1.06, SMALL_RAD, True, True, 0.05, 0.5)  # the box shows how far the direction is off
    judging.update_contrast(1.0 + FRAME_S, GOOD, 1.1)
    assert not judging.update_pair(1.0 + FRAME_S, 1.1, SMALL_RAD, True, True, 0.05)


def test_a_second_sighting_of_a_pair_does_not_count_as_a_second_pair() -> None:
    judging = judge()
    judging.update_contrast(1.0, GOOD, 1.06)
    for _ in range(5):
        assert not judging.update_pair(1.0, 1.06, SMALL_RAD, True, True, 0.05)


def test_while_verged_a_pair_counts_by_its_worst_measurement() -> None:
    judging = judge()
    judging.update_contrast(1.0, GOOD, 1.06)
    assert judging.update_pair(1.0, 1.06, SMALL_RAD, True, True, SURE)
    for i in range(1, 5):
        stamp_s = 1.0 + i * FRAME_S
        judging.update_contrast(stamp_s, GOOD, stamp_s + 0.06)
        assert judging.update_pair(
            stamp_s, stamp_s + 0.06, SMALL_RAD, True, True
        )  # the fovea, which measures the depth alone
        verged = judging.update_pair(stamp_s, stamp_s + 0.07, SMALL_RAD, True, True, direction_error_rad=0.03)
        assert verged is (i < 4)
        assert judging.update_pair(stamp_s, stamp_s + 0.08, SMALL_RAD, True, True, direction_error_rad=0.03) is verged


def test_a_bad_sighting_of_the_pair_that_made_it_verged_is_one_bad_pair() -> None:
    judging = judge()
    for i in range(6):
        judging.update_contrast(1.0 + i * FRAME_S, BAD, 1.06 + i * FRAME_S)
        judging.update_pair(1.0 + i * FRAME_S, 1.06 + i * FRAME_S, SMALL_RAD, True, True)
    judging.update_contrast(2.0, GOOD, 2.06)
    assert judging.update_pair(2.0, 2.06, SMALL_RAD, True, True, SURE)
    assert judging.update_pair(2.0, 2.07, SMALL_RAD, True, True, direction_error_rad=0.03)


def test_it_has_been_on_the_target_once_every_pair_of_a_while_showed_it_there() -> None:
    judging = judge()
    for i in range(14):
        stamp_s = 1.0 + i * FRAME_S
        judging.update_target(stamp_s, SMALL_RAD, SMALL_RAD)
        assert i > 10 or not judging.long_on_target(stamp_s + 0.06)
    assert judging.long_on_target(stamp_s + 0.06)
    assert not judging.long_on_target(stamp_s + 0.5)  # not seen since
    judging.update_target(1.1, SMALL_RAD, 0.03)  # arrived late: what came after it counts
    assert judging.long_on_target(stamp_s + 0.06)
    judging.update_target(stamp_s + FRAME_S, SMALL_RAD, 0.03)
    judging.update_target(stamp_s + 2 * FRAME_S, SMALL_RAD, SMALL_RAD)
    assert not judging.long_on_target(stamp_s + 2 * FRAME_S + 0.06)


@pytest.mark.parametrize("missing", ["steady", "resting"])
def test_certainty_of_one_pair_is_no_substitute_for_rest(missing: str) -> None:
    judging = judge()
    for i in range(4):
        stamp_s = 1.0 + i * FRAME_S
        judging.update_contrast(stamp_s, GOOD, stamp_s + 0.06)
        assert not judging.update_pair(
            stamp_s, stamp_s + 0.06, SMALL_RAD, missing != "steady", missing != "resting", SURE
        )


@pytest.mark.parametrize(
    ("error_rad", "aside_rad", "verged"), [(0.0, 0.012, True), (0.012, 0.0, False), (0.0, 0.014, False)]
)
def test_a_direction_need_not_be_nearer_than_the_dead_band_but_vergence_must(
    error_rad: float, aside_rad: float, verged: bool
) -> None:
    judging = judge()
    judging.dead_band_rad = 0.013
    judging.update_contrast(1.0, GOOD, 1.06)
    assert judging.update_pair(1.0, 1.06, error_rad, True, True, SURE, aside_rad) is verged


def test_losing_it_takes_several_pairs() -> None:
    judging = judge()
    judging.update_contrast(1.0, GOOD, 1.06)
    judging.update_pair(1.0, 1.06, SMALL_RAD, True, True, SURE)
    said = []
    for i in range(1, 5):
        judging.update_contrast(1.0 + i * FRAME_S, GOOD, 1.06 + i * FRAME_S)
        said.append(judging.update_pair(1.0 + i * FRAME_S, 1.06 + i * FRAME_S, 0.1, True, True, 1.0))
    assert said == [True, True, True, False]


def test_the_error_probability_is_the_share_that_is_off_after_all() -> None:
    """A world that is as the model has it: the stated probabilities add up to the trials that really were off."""
    random = np.random.default_rng(5)
    count, noise, wide = 200_000, 0.002, 0.012
    expected = random.normal(0.0, 0.004, count)
    true = expected + random.normal(0.0, wide, count)
    wrong = random.random(count) < 0.05
    seen = np.where(wrong, random.uniform(-0.25, 0.25, count), true + random.normal(0.0, noise, count))
    shown = np.flatnonzero(np.abs(seen) < 0.0085)
    said = [
        probability_beyond_limit(
            Gaussian(expected[i], wide), Gaussian(seen[i], noise), LIMIT_RAD, WRONG_SHARE, WRONG_RANGE_RAD
        )
        for i in shown
    ]
    off = np.count_nonzero(np.abs(true[shown]) > LIMIT_RAD)
    assert off > 30
    assert sum(said) == pytest.approx(off, rel=0.35)


def test_without_a_prediction_one_pair_is_not_certain_enough() -> None:
    alone = probability_beyond_limit(Gaussian(0.0, 1.0), Gaussian(0.0, 0.001), LIMIT_RAD, WRONG_SHARE, WRONG_RANGE_RAD)
    predicted = probability_beyond_limit(
        Gaussian(0.0, 0.005), Gaussian(0.0, 0.001), LIMIT_RAD, WRONG_SHARE, WRONG_RANGE_RAD
    )
    assert predicted < VergedParameters().single_pair_error_probability < alone


@given(*(st.floats(allow_nan=True, allow_infinity=True) for _ in range(4)))
@settings(deadline=None, max_examples=200)
def test_the_error_probability_is_a_probability_whatever_comes(
    mean: float, sigma: float, seen: float, noise: float
) -> None:
    assert (
        0.0
        <= probability_beyond_limit(
            Gaussian(mean, abs(sigma)), Gaussian(seen, abs(noise)), LIMIT_RAD, WRONG_SHARE, WRONG_RANGE_RAD
        )
        <= 1.0
    )


@given(st.floats(-0.1, 0.1), st.floats(1e-4, 0.1))
@settings(deadline=None, max_examples=100)
def test_the_probability_beyond_a_limit_agrees_with_drawing_from_it(mean: float, sigma: float) -> None:
    drawn = mean + sigma * np.random.default_rng(3).standard_normal(20_000)
    assert Gaussian(mean, sigma).probability_beyond(LIMIT_RAD) == pytest.approx(
        float(np.mean(np.abs(drawn) > LIMIT_RAD)), abs=0.02
    )


def test_what_is_not_known_may_be_beyond_any_limit() -> None:
    assert Gaussian(math.nan, 0.1).probability_beyond(1.0) == Gaussian(0.0, math.inf).probability_beyond(1.0) == 1.0
