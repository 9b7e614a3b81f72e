"""The law of the servos: whatever is asked, what is sent is finite, within limits, on the grid and never too fast."""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from vergence_servo.calibration import ServoCalibration, ServoCalibrationError, ServoLimits, servo_limits
from vergence_servo.safety import safe_pulse_us

ANYTHING = st.floats(allow_nan=True, allow_infinity=True)
GRIDS = st.sampled_from([0.001, 0.02, 1.0, 4.88, 5.0])


@st.composite
def limited_servos(draw: st.DrawFn) -> ServoLimits:
    """Any servo that servos.yaml may describe."""
    low_us, high_us = draw(st.floats(900, 1300)), draw(st.floats(1700, 2300))
    servo = ServoCalibration(
        channel=0,
        angles_rad=(-1.0, draw(st.floats(-0.3, 0.3)), 1.0),
        pulses_us=(low_us, draw(st.floats(low_us + 200, high_us - 200)), high_us),
        sign=draw(st.sampled_from([1, -1])),
        trim_rad=draw(st.floats(-0.4, 0.4)),
        minimum_us=draw(st.floats(600, 1200)),
        maximum_us=draw(st.floats(1800, 2400)),
        lower_rad=draw(st.floats(-1.2, -0.1)),
        upper_rad=draw(st.floats(0.1, 1.2)),
        speed_rad_s=draw(st.floats(0.1, 50)),
    )
    try:
        limits = servo_limits("any", servo)
    except ServoCalibrationError:
        assume(False)
        raise
    assume(limits.maximum_us - limits.minimum_us > 20.0)
    return limits


@settings(deadline=None, max_examples=500)
@given(limits=limited_servos(), wanted=ANYTHING, last=ANYTHING, elapsed=ANYTHING, speed=ANYTHING, grid=GRIDS)
def test_every_pulse_is_finite_within_limits_and_on_the_grid(
    limits: ServoLimits, wanted: float, last: float, elapsed: float, speed: float, grid: float
):
    pulse_us = safe_pulse_us(wanted, last, elapsed, limits, grid, speed)
    assert math.isfinite(pulse_us)
    assert limits.minimum_us <= pulse_us <= limits.maximum_us
    assert limits.lower_rad - 1e-12 <= limits.calibration.joint_rad(pulse_us) <= limits.upper_rad + 1e-12
    assert pulse_us / grid == pytest.approx(round(pulse_us / grid), abs=1e-6)


@settings(deadline=None, max_examples=500)
@given(
    limits=limited_servos(),
    wanted=st.lists(ANYTHING, min_size=1, max_size=20),
    elapsed=st.floats(0.0001, 0.05),
    grid=GRIDS,
)
def test_no_step_is_faster_than_the_slew_limit(limits: ServoLimits, wanted: list[float], elapsed: float, grid: float):
    last_us = safe_pulse_us(0.0, 1500.0, 0.0, limits, grid)
    sent_s = 0.0
    now_s = 0.0
    for goal_rad in wanted:
        now_s += elapsed
        pulse_us = safe_pulse_us(goal_rad, last_us, now_s - sent_s, limits, grid)
        if pulse_us != last_us:
            way_rad = abs(limits.calibration.joint_rad(pulse_us) - limits.calibration.joint_rad(last_us))
            assert way_rad <= limits.max_speed_rad_s * (now_s - sent_s) * (1 + 1e-9) + 1e-12
            last_us, sent_s = pulse_us, now_s


@settings(deadline=None, max_examples=200)
@given(limits=limited_servos(), share=st.floats(0, 1), grid=GRIDS)
def test_every_reachable_angle_is_reached_to_half_a_step(limits: ServoLimits, share: float, grid: float):
    wanted_rad = limits.lower_rad + share * (limits.upper_rad - limits.lower_rad)
    pulse_us, sent_s, now_s = safe_pulse_us(0.0, 1500.0, 0.0, limits, grid), 0.0, 0.0
    for _ in range(1500):
        now_s += 0.02
        fresh_us = safe_pulse_us(wanted_rad, pulse_us, now_s - sent_s, limits, grid)
        if fresh_us != pulse_us:
            pulse_us, sent_s = fresh_us, now_s
        elif now_s - sent_s > 5.0:
            break
    # at the ends of the range the nearest pulse of the grid may lie outside the limits
    wanted_us = limits.calibration.pulse_us(wanted_rad)
    assert abs(wanted_us - pulse_us) <= 1.0001 * grid
    if limits.minimum_us + 0.5 * grid < wanted_us < limits.maximum_us - 0.5 * grid:
        assert abs(wanted_us - pulse_us) <= 0.5001 * grid


@pytest.mark.parametrize("wanted", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_moves_nothing(wanted: float):
    limits = servo_limits("pan", ServoCalibration(channel=0))
    assert safe_pulse_us(wanted, 1600.0, 1.0, limits, 1.0) == 1600.0


def test_after_a_rest_a_move_begins_with_one_pulse_period():
    limits = servo_limits("pan", ServoCalibration(channel=0, speed_rad_s=1.0))
    first_us = safe_pulse_us(1.0, 1500.0, 3600.0, limits, 0.001)
    assert limits.calibration.joint_rad(first_us) == pytest.approx(0.02, abs=1e-5)


def test_a_grid_coarser_than_the_limits_is_refused():
    limits = ServoLimits(ServoCalibration(channel=0), 1501.0, 1504.0, 1.0)
    with pytest.raises(ValueError, match=r"resolution_us must .* got 10"):
        safe_pulse_us(0.0, 1500.0, 0.1, limits, 10.0)
