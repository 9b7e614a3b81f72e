import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.measurement.foveal_vergence import FovealVergenceClassifier
from vergence_metric.measurement.parameters import VergedParameters
from vergence_rig.parameters import ParameterError

PX = 1.0 / 539.0
P = VergedParameters(contrast_enter=0.6, contrast_leave=0.72, enter_rad=2.0 * PX, leave_rad=4.0 * PX)


def classify(*evidence: tuple[float, float, float]) -> list[bool]:
    classifier = FovealVergenceClassifier(P)
    return [classifier.update(contrast, PX * error_px, confidence) for contrast, error_px, confidence in evidence]


def test_it_takes_low_contrast_and_a_small_confident_error() -> None:
    assert classify((0.3, 0.5, 0.9)) == [True]
    assert classify((0.3, -0.5, 0.9)) == [True]
    assert classify((0.65, 0.5, 0.9)) == [False]
    assert classify((0.3, 2.5, 0.9)) == [False]
    assert classify((0.3, 0.5, 0.4)) == [False]
    assert classify((0.3, math.nan, 0.9)) == [False]


def test_between_the_thresholds_it_stays_as_it_is() -> None:
    between = (0.66, 3.0, 0.9)
    assert classify((0.3, 0.0, 0.9), between, between) == [True, True, True]
    assert classify((0.9, 0.0, 0.9), between, between) == [False, False, False]


@pytest.mark.parametrize("end", [(0.8, 0.0, 0.9), (0.3, 5.0, 0.9), (0.3, -5.0, 0.9), (math.nan, 0.0, 0.9)])
def test_it_is_cleared_by_high_contrast_a_large_error_or_no_contrast(end: tuple[float, float, float]) -> None:
    assert classify((0.3, 0.0, 0.9), end) == [True, False]


def test_an_error_without_confidence_clears_nothing() -> None:
    assert classify((0.3, 0.0, 0.9), (0.5, math.nan, 0.0), (0.5, 50.0, 0.1)) == [True, True, True]


@settings(deadline=None, max_examples=100)
@given(st.lists(st.tuples(st.floats(0, 2), st.floats(-20, 20), st.floats(0, 1)), max_size=20))
def test_verged_never_shows_with_high_contrast_or_a_large_confident_error(
    evidence: list[tuple[float, float, float]],
) -> None:
    classifier = FovealVergenceClassifier(P)
    for contrast, error, confidence in evidence:
        if classifier.update(contrast, PX * error, confidence):
            assert contrast <= P.contrast_leave
            assert confidence < P.min_confidence or abs(PX * error) <= P.leave_rad


@pytest.mark.parametrize("name", ["contrast_leave", "leave_rad"])
def test_leaving_below_entering_is_refused(name: str) -> None:
    with pytest.raises(ParameterError, match=name):
        VergedParameters.from_mapping({name: 0.001})
