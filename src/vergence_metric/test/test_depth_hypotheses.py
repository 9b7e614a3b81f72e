"""The distances that a target may have: what pairs say fades, and a rival as good as the best leaves none certain."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_metric.tracking.depth_hypotheses import DepthHypotheses

APART_RAD = 0.01
RESTING = 0.1  # the vergence that the joints report [rad]


def hypotheses() -> DepthHypotheses:
    return DepthHypotheses(memory=0.85, apart_rad=APART_RAD, share=0.4)


def test_a_confident_pair_is_certain_at_once() -> None:
    depths = hypotheses()
    assert depths.best is None
    assert not depths.certain
    assert depths.update([(0.1, 0.9), (0.2, 0.05)], RESTING) is depths.best
    assert depths.certain


def test_rivals_as_good_leave_none_certain() -> None:
    depths = hypotheses()
    for _ in range(30):
        depths.update([(0.1, 0.5), (0.2, 0.5)], RESTING)
    assert not depths.certain
    assert {round(one.parallax_rad, 3) for one in depths.ranked} == {0.1, 0.2}


def test_one_wrong_pair_changes_nothing_and_many_do() -> None:
    depths = hypotheses()
    for _ in range(10):
        depths.update([(0.1, 0.9)], RESTING)
    assert depths.update([(0.2, 0.9)], RESTING) is not depths.best
    assert depths.certain
    for _ in range(10):
        depths.update([(0.2, 0.9)], RESTING)
    assert depths.best is not None
    assert depths.best.parallax_rad == pytest.approx(0.2)
    assert depths.certain


def test_pairs_that_find_nothing_take_the_certainty_away() -> None:
    depths = hypotheses()
    depths.update([(0.1, 0.9)], RESTING)
    for _ in range(10):
        depths.update([], RESTING)
    assert not depths.certain


def test_a_hypothesis_moves_along_with_the_joints_errors() -> None:
    depths = hypotheses()
    depths.update([(0.1, 0.9), (0.13, 0.1)], RESTING)
    depths.update([(0.1 + 0.8 * APART_RAD, 0.9), (0.13 + 0.8 * APART_RAD, 0.1)], RESTING)
    assert len(depths.ranked) == 2
    assert depths.ranked[0].parallax_rad == pytest.approx(0.1 + 0.8 * APART_RAD)


def test_the_unseen_moves_along_too() -> None:
    depths = hypotheses()
    depths.update([(0.1, 0.7), (0.13, 0.3)], RESTING)
    depths.update([(0.1 + 0.8 * APART_RAD, 0.9)], RESTING)
    assert [one.parallax_rad for one in depths.ranked] == pytest.approx([0.1 + 0.8 * APART_RAD, 0.13 + 0.8 * APART_RAD])


@pytest.mark.parametrize("play_rad", [0.019, -0.019])
def test_a_report_of_a_turn_that_play_took_up_changes_no_distance(play_rad: float) -> None:
    depths = hypotheses()
    for _ in range(10):
        depths.update([(0.1, 0.9), (0.12, 0.1)], RESTING)
    # The images are as before, the joints report a turn: each parallax that is computed is off by it.
    assert depths.update([(0.1 + play_rad, 0.9), (0.12 + play_rad, 0.1)], RESTING + play_rad) is depths.best
    assert depths.certain
    assert [one.parallax_rad for one in depths.ranked] == pytest.approx([0.1 + play_rad, 0.12 + play_rad])


def test_a_turn_while_nothing_was_found_is_remembered() -> None:
    depths = hypotheses()
    depths.update([(0.1, 0.9)], RESTING)
    depths.update([], RESTING + 0.01)
    depths.update([(0.3, 0.3)], RESTING + 0.019)  # a wrong match
    assert depths.update([(0.1 + 0.019, 0.9)], RESTING + 0.019) is depths.best
    assert depths.ranked[0].parallax_rad == pytest.approx(0.119)


def test_a_repetition_is_no_shift_while_the_joints_rest() -> None:
    depths = hypotheses()
    for _ in range(10):
        depths.update([(0.1, 0.9)], RESTING)
    depths.update([(0.1 + 1.5 * APART_RAD, 0.9)], RESTING)
    assert [one.parallax_rad for one in depths.ranked] == pytest.approx([0.1, 0.1 + 1.5 * APART_RAD])
    nearer = hypotheses()
    for _ in range(10):
        nearer.update([(0.1, 0.9)], RESTING)
    nearer.update([(0.1 + 0.9 * APART_RAD, 0.9), (0.1, 0.1)], RESTING)
    assert nearer.ranked[0].parallax_rad == pytest.approx(0.1)


def test_those_that_a_pair_does_not_tell_apart_are_one() -> None:
    depths = hypotheses()
    for _ in range(5):
        depths.update([(0.1, 0.6), (0.1 + 0.3 * APART_RAD, 0.4)], RESTING)
    assert not depths.certain
    depths.update([(0.1 + 0.15 * APART_RAD, 1.0)], RESTING)
    assert [one.weight for one in depths.ranked] == [pytest.approx(0.6 * 5 / 6 + 1 / 6)]


PAIRS = st.lists(
    st.lists(st.tuples(st.floats(-0.1, 0.4), st.floats(0.0, 1.0)), max_size=6).map(
        lambda pair: [(parallax, share / max(len(pair), 1)) for parallax, share in pair]
    ),
    max_size=30,
)


@given(PAIRS, st.lists(st.floats(-0.1, 0.4), min_size=30, max_size=30))
def test_weights_are_shares_and_ranked(pairs: list[list[tuple[float, float]]], vergences_rad: list[float]) -> None:
    depths = hypotheses()
    for pair, vergence_rad in zip(pairs, vergences_rad, strict=False):
        depths.update(pair, vergence_rad)
        weights = [one.weight for one in depths.ranked]
        assert weights == sorted(weights, reverse=True)
        assert sum(weights) <= 1.0 + 1e-9
        if depths.certain:
            assert weights[0] >= 0.4
