"""The limits of one pair: which window counts, what speaks against it, and that the hystereses stay in order."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_rig.parameters import ParameterError
from vergence_rig.verged import VergedLimits, best_small_window, objection

LIMITS = VergedLimits()


def test_the_least_contrast_of_the_small_windows_counts() -> None:
    assert best_small_window([300, 50, 100, 150, 200], [0.1, 0.5, 0.3, 0.4, 0.0]) == 2
    assert best_small_window([50, 100], [math.nan, 0.9]) == 1
    assert best_small_window([50, 300], [math.nan, 0.2]) is None
    assert best_small_window([], []) is None


def test_an_error_or_a_contrast_beyond_its_limit_is_named() -> None:
    errors = [("vergence", 0.001, 0.004), ("direction", 0.002, 0.008)]
    assert objection(0.3, 0.8, errors) == ""
    assert objection(0.3, 0.8, [("vergence", -0.0175, 0.004)]) == "vergence error 1.00 deg"
    assert objection(0.9, 0.8, errors) == "edge contrast 0.90 above 0.80"
    assert objection(math.nan, 0.8, errors) == "", "a contrast that is not used"
    assert "nan" in objection(0.3, 0.8, [("vergence", math.nan, 0.004)])


@given(st.floats(0, 2), st.floats(-0.1, 0.1))
def test_what_becomes_verged_would_stay_verged(contrast: float, error_rad: float) -> None:
    p = LIMITS
    if not objection(contrast, p.contrast_limit(verged=False), [("vergence", error_rad, p.enter_rad)]):
        assert not objection(contrast, p.contrast_limit(verged=True), [("vergence", error_rad, p.leave_rad)])


@pytest.mark.parametrize("name", ["contrast_leave", "leave_rad"])
def test_leaving_below_entering_is_refused(name: str) -> None:
    with pytest.raises(ParameterError, match=name):
        VergedLimits.from_mapping({name: 0.001})
