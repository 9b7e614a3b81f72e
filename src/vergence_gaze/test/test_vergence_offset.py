"""Which readings of the visual encoder are accepted, and with what variance."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_gaze.estimation.distance import joint_variances
from vergence_gaze.estimation.vergence_offset import VergenceOffset, farthest_offset_rad
from vergence_rig.rig import default_rig
from vergence_rig.servo import SG90

RIG = default_rig().with_servos(SG90)
SIGMA_RAD = 3e-4


def offset() -> VergenceOffset:
    return VergenceOffset(joint_variances(RIG), farthest_offset_rad(RIG))


@pytest.mark.parametrize(
    ("difference", "sigma"), [(math.nan, 0.001), (0.5, 0.001), (0.001, 0.0), (0.001, math.inf), (0.001, math.nan)]
)
def test_readings_of_no_use_change_nothing(difference: float, sigma: float) -> None:
    learnt = offset()
    before = learnt.variance
    for i in range(3):
        assert not learnt.update(1.0 + i, difference, sigma)
    assert (learnt.offset_rad, learnt.variance, learnt.known) == (0.0, before, False)
    assert (learnt.accepted, learnt.rejected) == (0, 3)
    assert learnt.rejection


def test_a_reading_beyond_servos_and_mounts_is_rejected_with_both_figures() -> None:
    learnt = offset()
    assert not learnt.update(1.0, math.radians(4.0), SIGMA_RAD)
    assert "4.00 degrees" in learnt.rejection
    assert f"{math.degrees(farthest_offset_rad(RIG)):.2f}" in learnt.rejection


def test_one_odd_reading_waits_for_a_second_that_agrees() -> None:
    odd = math.radians(0.6)
    learnt = offset()
    assert not learnt.update(1.0, odd, SIGMA_RAD)
    assert "once" in learnt.rejection
    assert learnt.update(2.0, odd + SIGMA_RAD, SIGMA_RAD)
    assert learnt.offset_rad == pytest.approx(odd + SIGMA_RAD)
    assert math.sqrt(learnt.variance) == pytest.approx(SIGMA_RAD)


def test_odd_readings_that_do_not_agree_are_never_accepted() -> None:
    learnt = offset()
    assert not any(learnt.update(1.0 + i, math.radians(0.6 if i % 2 else -0.6), SIGMA_RAD) for i in range(6))


def test_a_wrong_reading_amid_good_ones_is_left_out() -> None:
    learnt = offset()
    for i, difference in enumerate((0.001, 0.001, 0.012, 0.001)):
        assert learnt.update(1.0 + i, difference, SIGMA_RAD) == (difference < 0.01)
    assert learnt.offset_rad == pytest.approx(0.001, abs=2e-4)


def test_readings_of_before_the_rest_or_seen_already_are_rejected() -> None:
    learnt = offset()
    assert learnt.update(1.0, 0.001, SIGMA_RAD)
    assert not learnt.update(1.0, 0.001, SIGMA_RAD)
    learnt.on_pan_moved(5.0)
    assert not learnt.known
    assert not learnt.update(4.9, 0.001, SIGMA_RAD)
    assert learnt.update(5.1, 0.001, SIGMA_RAD)


@settings(deadline=None, max_examples=100)
@given(readings=st.lists(st.tuples(st.floats(-0.05, 0.05), st.floats(1e-5, 0.01)), min_size=1, max_size=30))
def test_however_often_it_reads_one_rest_it_is_no_surer_than_its_best_reading_allows(
    readings: list[tuple[float, float]],
) -> None:
    learnt = offset()
    prior = learnt.variance
    for i, (difference, sigma) in enumerate(readings):
        learnt.update(1.0 + i, difference, sigma)
        assert math.isfinite(learnt.offset_rad)
        assert abs(learnt.offset_rad) <= max(abs(value) for value, _ in readings)
        assert learnt.variance <= max(prior, max(sigma for _, sigma in readings) ** 2)
    best = min(sigma for _, sigma in readings)
    assert learnt.variance >= min(0.4 * best**2, prior)
    assert np.isfinite(learnt.variance)
