import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.edges.parameters import EdgeMetricParameters
from vergence_metric.measurement.verged import VergedJudge
from vergence_rig.parameters import ParameterError

P = EdgeMetricParameters(verged_contrast=0.6, verged_leave_contrast=0.72, verged_px=2.0, verged_leave_px=4.0)


def judge(*evidence: tuple[float, float, float]) -> list[bool]:
    judging = VergedJudge(P)
    return [judging.update(*each) for each in evidence]


def test_it_takes_low_contrast_and_a_small_confident_error() -> None:
    assert judge((0.3, 0.5, 0.9)) == [True]
    assert judge((0.3, -0.5, 0.9)) == [True]
    assert judge((0.65, 0.5, 0.9)) == [False]
    assert judge((0.3, 2.5, 0.9)) == [False]
    assert judge((0.3, 0.5, 0.4)) == [False]
    assert judge((0.3, math.nan, 0.9)) == [False]


def test_between_the_thresholds_it_stays_as_it_is() -> None:
    between = (0.66, 3.0, 0.9)
    assert judge((0.3, 0.0, 0.9), between, between) == [True, True, True]
    assert judge((0.9, 0.0, 0.9), between, between) == [False, False, False]


@pytest.mark.parametrize("end", [(0.8, 0.0, 0.9), (0.3, 5.0, 0.9), (0.3, -5.0, 0.9), (math.nan, 0.0, 0.9)])
def test_it_ends_on_high_contrast_a_large_error_or_nothing_to_judge(end: tuple[float, float, float]) -> None:
    assert judge((0.3, 0.0, 0.9), end) == [True, False]


def test_an_estimator_that_does_not_know_ends_nothing() -> None:
    assert judge((0.3, 0.0, 0.9), (0.5, math.nan, 0.0), (0.5, 50.0, 0.1)) == [True, True, True]


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(st.floats(0, 2), st.floats(-20, 20), st.floats(0, 1)), max_size=20))
def test_verged_never_shows_with_high_contrast_or_a_large_confident_error(
    evidence: list[tuple[float, float, float]],
) -> None:
    judging = VergedJudge(P)
    for contrast, error, confidence in evidence:
        if judging.update(contrast, error, confidence):
            assert contrast <= P.verged_leave_contrast
            assert confidence < P.verged_confidence or abs(error) <= P.verged_leave_px


@pytest.mark.parametrize("name", ["verged_leave_contrast", "verged_leave_px"])
def test_leaving_below_entering_is_refused(name: str) -> None:
    with pytest.raises(ParameterError, match=name):
        EdgeMetricParameters.from_mapping({name: 0.1})
