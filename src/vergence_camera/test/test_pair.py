"""Faults of a pair of cameras, each with its remedy."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_camera.pair import EyeCamera, SkewMeter, faults_of_pair

GOOD = {"gain": 10, "auto_exposure": "Manual Mode", "exposure_time_absolute": 200}


def test_a_good_pair() -> None:
    left, right = (
        EyeCamera("left", "a", 30.0, GOOD),
        EyeCamera("right", "b", 29.9, {**GOOD, "exposure_time_absolute": 202}),
    )
    assert faults_of_pair(left, right, 0.008, 0.017) == []


def test_what_is_not_known_is_no_fault() -> None:
    assert faults_of_pair(EyeCamera("left"), EyeCamera("right"), math.nan, 0.017) == []


@pytest.mark.parametrize(
    ("right", "skew_s", "words"),
    [
        (EyeCamera("right", "a", 30.0, GOOD), 0.0, ["share USB controller a"]),
        (EyeCamera("right", "b", 15.0, GOOD), 0.0, ["30.0 Hz", "15.0 Hz"]),
        (EyeCamera("right", "b", 30.0, {**GOOD, "gain": 20}), 0.0, ["gain 10 and 20", "hold", "follow"]),
        (EyeCamera("right", "b", 30.0, {**GOOD, "auto_exposure": "Auto"}), 0.0, ["auto_exposure"]),
        (EyeCamera("right", "b", 30.0, GOOD), -0.03, ["30.0 ms apart", "17.0 ms"]),
    ],
)
def test_each_fault_is_said(right: EyeCamera, skew_s: float, words: list[str]) -> None:
    (fault,) = faults_of_pair(EyeCamera("left", "a", 30.0, GOOD), right, skew_s, 0.017)
    assert all(word in fault for word in words)


@settings(deadline=None, max_examples=60)
@given(st.integers(-16, 16), st.integers(5, 50))
def test_skew_is_that_to_the_nearest_frame(skew_ms: int, count: int) -> None:
    meter = SkewMeter()
    for number in range(count):
        meter.add_other(number * 33_000_000)
        meter.add_own(number * 33_000_000 + skew_ms * 1_000_000)
    assert meter.skew_s() == pytest.approx(skew_ms * 1e-3, abs=1e-9)
    assert meter.other_rate_hz() == pytest.approx(1e3 / 33.0)


def test_skew_needs_both() -> None:
    meter = SkewMeter()
    assert math.isnan(meter.skew_s())
    meter.add_own(1)
    assert math.isnan(meter.skew_s())
    assert math.isnan(meter.other_rate_hz())
