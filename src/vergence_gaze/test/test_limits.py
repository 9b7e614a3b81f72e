"""The command limits: by number, and under a hundred thousand hostile commands."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_gaze.joints.limits import LONGEST_STEP_S, CommandLimits
from vergence_gaze.joints.smooth_limits import SmoothLimits
from vergence_rig.rig import Rig, default_rig
from vergence_rig.servo import IDEAL

RIG = default_rig()
ZERO = np.zeros(3)


@pytest.fixture
def limits() -> CommandLimits:
    return CommandLimits(RIG)


def test_the_first_command_is_where_the_joints_are(limits: CommandLimits) -> None:
    present = np.array([-0.1, 0.1, 0.2])
    np.testing.assert_allclose(limits.limited(ZERO, None, math.nan, present), present)
    outside = np.array([-2.0, 2.0, 2.0])
    np.testing.assert_allclose(limits.limited(ZERO, None, math.nan, outside), limits.nearest(outside))


def test_speed_limit(limits: CommandLimits) -> None:
    sent = limits.limited(np.array([1.0, 1.0, 0.5]), np.array([0.0, 0.01, 0.0]), 0.01, ZERO)
    speeds = [joint.speed_rad_s * 0.01 for _, joint in RIG.joints.items()]
    np.testing.assert_allclose(sent, np.array([0.0, 0.01, 0.0]) + speeds)


def test_a_long_sleep_is_not_made_up_for(limits: CommandLimits) -> None:
    sent = limits.limited(np.array([0.0, 0.1, 0.7]), np.array([0.0, 0.1, -0.7]), 1000.0, ZERO)
    assert sent[2] == pytest.approx(-0.7 + RIG.tilt.speed_rad_s * LONGEST_STEP_S)


def test_eyes_that_would_diverge_look_at_infinity_between_both() -> None:
    sent = CommandLimits(RIG.with_servos(IDEAL)).nearest(np.array([0.2, 0.1, 0.0]))
    np.testing.assert_allclose(sent[:2], [0.15, 0.15], atol=1e-8)
    assert sent[1] >= sent[0]


def test_commands_may_diverge_by_the_play_so_that_the_eyes_become_parallel(limits: CommandLimits) -> None:
    servo = RIG.pan_left.servo
    half_play = 0.5 * (servo.dead_band_rad + servo.backlash_rad)
    sent = limits.nearest(np.array([0.2, 0.1, 0.0]))
    np.testing.assert_allclose(sent[:2], [0.15 + half_play, 0.15 - half_play], atol=1e-8)
    # each shaft stays behind its command by half its play
    assert (sent[1] + half_play) - (sent[0] - half_play) >= 0.0


def test_vergence_limit_on_the_way(limits: CommandLimits) -> None:
    last = np.array([0.0, 0.02, 0.0])
    for wanted in ([0.5, 0.5, 0.0], [0.5, 0.03, 0.0], [0.02, -0.5, 0.0]):
        assert limits.allows(limits.limited(np.array(wanted), last, 0.05, last))


@pytest.mark.parametrize("way_rad", [0.5, -0.5])
@pytest.mark.parametrize("speeds", [(1.0, 1.03), (1.03, 1.0)])
def test_parallel_eyes_turn_although_one_pan_is_faster(way_rad: float, speeds: tuple[float, float]) -> None:
    limits = CommandLimits(RIG.with_servos(IDEAL))
    sent = np.array([0.0, limits.minimum_vergence_rad, 0.0])
    for _ in range(100):
        sent = limits.limited(np.array([way_rad, way_rad + 0.02, 0.0]), sent, 0.02, sent, np.array([*speeds, 1.0]))
        assert limits.allows(sent)
    np.testing.assert_allclose(sent, [way_rad, way_rad + 0.02, 0.0])


def test_joints_that_are_not_numbers_stay(limits: CommandLimits) -> None:
    last = np.array([-0.1, 0.1, 0.2])
    np.testing.assert_array_equal(limits.limited(np.full(3, math.nan), last, 0.01, last), last)
    sent = limits.limited(np.array([math.inf, 0.15, -math.inf]), last, 0.01, last)
    np.testing.assert_allclose(sent, [-0.1, 0.15, 0.2])


@pytest.mark.parametrize("elapsed_s", [0.0, -1.0, math.nan, math.inf, -math.inf])
def test_time_that_does_not_pass_moves_nothing(limits: CommandLimits, elapsed_s: float) -> None:
    last = np.array([-0.1, 0.1, 0.2])
    np.testing.assert_array_equal(limits.limited(np.array([0.0, 0.2, 0.0]), last, elapsed_s, last), last)


@pytest.mark.parametrize("minimum_rad", [0.0, 0.05])
def test_a_hundred_thousand_hostile_commands(minimum_rad: float) -> None:
    rig = Rig(minimum_vergence_rad=minimum_rad).with_servos(IDEAL, RIG.tilt.servo)
    limits = CommandLimits(rig)
    random = np.random.default_rng(7)
    count = 50_000
    wanted = random.normal(0.0, 1.5, (count, 3))
    odd = random.random((count, 3))
    wanted[odd < 0.05] = math.nan
    wanted[(odd >= 0.05) & (odd < 0.08)] = math.inf
    wanted[(odd >= 0.08) & (odd < 0.11)] = -math.inf
    wanted[(odd >= 0.11) & (odd < 0.13)] *= 1e300
    elapsed = random.choice([0.001, 0.01, 0.05, 1.0, 0.0, -0.5, math.nan, math.inf], count)
    last = limits.limited(ZERO, None, math.nan, np.array([0.4, -0.4, 2.0]))
    for i in range(count):
        sent = limits.limited(wanted[i], last, elapsed[i], ZERO)
        passed_s = min(elapsed[i], LONGEST_STEP_S) if math.isfinite(elapsed[i]) and elapsed[i] > 0 else 0.0
        assert limits.allows(sent), (i, wanted[i], last, sent)
        assert (np.abs(sent - last) <= limits.speed_rad_s * passed_s + 1e-12).all(), (i, wanted[i], last, sent)
        last = sent


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.lists(st.floats(-3.0, 3.0) | st.just(math.nan), min_size=3, max_size=3), st.integers(1, 40)),
        min_size=1,
        max_size=8,
    ),
    st.floats(0.1, 5.0),
    st.floats(1.0, 60.0),
)
def test_smooth_limits_hold_speed_and_acceleration_and_all_others(
    desired: list[tuple[list[float], int]], speed_rad_s: float, acceleration_rad_s2: float
) -> None:
    limits, plain, step_s = SmoothLimits(RIG, speed_rad_s, acceleration_rad_s2), CommandLimits(RIG), 0.02
    last, rate = np.zeros(3), np.zeros(3)
    for angles, count in desired:
        for _ in range(count):
            sent = limits.limited(np.array(angles), last, step_s, np.zeros(3))
            assert plain.allows(sent, 1e-9)
            now = (sent - last) / step_s
            assert (np.abs(now) <= np.minimum(speed_rad_s, plain.speed_rad_s) + 1e-9).all()
            # The joints' own limits may stop a joint faster; none starts faster, unless both eyes' common one moves it.
            faster = np.abs(now) > np.abs(rate) + acceleration_rad_s2 * step_s + 1e-6
            parallel = min(sent[1] - sent[0], last[1] - last[0]) < plain.minimum_vergence_rad + 1e-3
            assert not (faster[2] if parallel else faster.any())
            last, rate = sent, now


def test_smooth_limits_arrive_and_do_not_overshoot() -> None:
    limits, last, wanted = SmoothLimits(RIG, 2.5, 20.0), np.zeros(3), np.array([0.5, 0.55, -0.3])
    for _ in range(100):
        sent = limits.limited(wanted, last, 0.02, np.zeros(3))
        assert (np.abs(wanted - sent) <= np.abs(wanted - last) + 1e-12).all()
        last = sent
    assert last == pytest.approx(wanted, abs=1e-4)
