"""The distances that a target may have: what pairs say fades, and a rival as good as the best leaves none certain."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_metric.tracking.depth_hypotheses import DepthHypotheses

APART_RAD = 0.01


def hypotheses() -> DepthHypotheses:
    return DepthHypotheses(memory=0.85, apart_rad=APART_RAD, share=0.4)


def test_a_confident_pair_is_certain_at_once() -> None:
    depths = hypotheses()
    assert depths.best is None
    assert not depths.certain
    assert depths.update([(0.1, 0.9), (0.2, 0.05)]) is depths.best
    assert depths.certain


def test_rivals_as_good_leave_none_certain() -> None:
    depths = hypotheses()
    for _ in range(30):
        depths.update([(0.1, 0.5), (0.2, 0.5)])
    assert not depths.certain
    assert {round(one.parallax_rad, 3) for one in depths.ranked} == {0.1, 0.2}


def test_one_wrong_pair_changes_nothing_and_many_do() -> None:
    depths = hypotheses()
    for _ in range(10):
        depths.update([(0.1, 0.9)])
    assert depths.update([(0.2, 0.9)]) is not depths.best
    assert depths.certain
    for _ in range(10):
        depths.update([(0.2, 0.9)])
    assert depths.best is not None
    assert depths.best.parallax_rad == pytest.approx(0.2)
    assert depths.certain


def test_pairs_that_find_nothing_take_the_certainty_away() -> None:
    depths = hypotheses()
    depths.update([(0.1, 0.9)])
    for _ in range(10):
        depths.update([])
    assert not depths.certain


def test_a_hypothesis_moves_along_with_the_joints_errors() -> None:
    depths = hypotheses()
    depths.update([(0.1, 0.9), (0.13, 0.1)])
    depths.update([(0.1 + 0.8 * APART_RAD, 0.9), (0.13 + 0.8 * APART_RAD, 0.1)])
    assert len(depths.ranked) == 2
    assert depths.ranked[0].parallax_rad == pytest.approx(0.1 + 0.8 * APART_RAD)


PAIRS = st.lists(
    st.lists(st.tuples(st.floats(-0.1, 0.4), st.floats(0.0, 1.0)), max_size=6).map(
        lambda pair: [(parallax, share / max(len(pair), 1)) for parallax, share in pair]
    ),
    max_size=30,
)


@given(PAIRS)
def test_weights_are_shares_and_ranked(pairs: list[list[tuple[float, float]]]) -> None:
    depths = hypotheses()
    for pair in pairs:
        depths.update(pair)
        weights = [one.weight for one in depths.ranked]
        assert weights == sorted(weights, reverse=True)
        assert sum(weights) <= 1.0 + 1e-9
        if depths.certain:
            assert weights[0] >= 0.4
