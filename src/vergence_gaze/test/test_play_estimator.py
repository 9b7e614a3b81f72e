"""The play of a joint, learnt from reversals, and heads whose servos are not those of rig.yaml."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_gaze.control.controller import GazeController
from vergence_gaze.goals.goal import Goal, GoalKind
from vergence_gaze.joints.play_estimator import PlayEstimator
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.testing.fake_head import TICK_S, FakeHead, VisionModel
from vergence_rig.rig import default_rig
from vergence_rig.servo import IDEAL, SG90, ServoSpec

CONTROL_TICKS = 6


def observed(estimator: PlayEstimator, true_half_play: float, reported: list[float], every_s: float = 0.2) -> None:
    """Let a joint with this play pass through reported angles before a target at rest."""
    shaft = reported[0]
    for i, angle in enumerate(reported):
        shaft = min(max(shaft, angle - true_half_play), angle + true_half_play)
        estimator.follow(every_s * i, np.full(3, angle))
        estimator.observe(every_s * i, np.full(3, -shaft))


@given(st.floats(0.0, 0.02), st.floats(0.0, 0.02))
def test_reversals_show_the_play(described: float, true: float) -> None:
    estimator = PlayEstimator(np.full(3, described), 0.7)
    observed(estimator, true, [0.0] + [0.1, 0.0] * 6)
    np.testing.assert_allclose(estimator.half_play_rad, true, atol=1e-3)


def test_moves_without_a_reversal_teach_nothing() -> None:
    estimator = PlayEstimator(np.full(3, 0.01), 0.7)
    observed(estimator, 0.0, [0.0, 0.1, 0.2, 0.3])
    np.testing.assert_array_equal(estimator.half_play_rad, 0.01)


def test_a_move_that_the_image_does_not_show_lies_in_the_play() -> None:
    estimator = PlayEstimator(np.full(3, 0.002), 1.0)
    observed(estimator, 0.01, [0.0, 0.1, 0.088])
    np.testing.assert_allclose(estimator.half_play_rad, 0.006)


def test_a_joint_that_was_not_seen_keeps_its_play() -> None:
    estimator = PlayEstimator(np.full(3, 0.01), 0.7)
    for i, angle in enumerate((0.0, 0.1, 0.0)):
        estimator.follow(0.2 * i, np.full(3, angle))
        estimator.observe(0.2 * i, np.array([-angle, math.nan, -angle]))
    assert estimator.half_play_rad[1] == 0.01
    assert estimator.half_play_rad[0] < 0.01


def test_a_joint_that_turned_back_unseen_teaches_nothing() -> None:
    estimator = PlayEstimator(np.full(3, 0.01), 0.7)
    shaft, seen_at = 0.0, (0.0, 0.195, 0.190)
    for i, angle in enumerate((0.0, 0.1, 0.2, 0.195, 0.190)):  # too far, and back by less than the play
        shaft = min(max(shaft, angle - 0.01), angle + 0.01)
        estimator.follow(0.1 * i, np.full(3, angle))
        if angle in seen_at:
            estimator.observe(0.1 * i, np.full(3, -shaft))
    np.testing.assert_array_equal(estimator.half_play_rad, 0.01)


def test_moves_that_are_lost_add_up() -> None:
    estimator = PlayEstimator(np.full(3, 0.002), 1.0)
    observed(estimator, 0.01, [0.0, 0.1, 0.092, 0.084, 0.07])
    np.testing.assert_allclose(estimator.half_play_rad, 0.01)


@given(st.lists(st.floats(-0.2, 0.2), min_size=2, max_size=30), st.floats(0.001, 0.015), st.integers(1, 4))
def test_play_that_is_as_described_stays_so(angles: list[float], true: float, seen_every: int) -> None:
    estimator, shaft = PlayEstimator(np.full(3, true), 0.7), angles[0] + 0.3 * true
    for i, angle in enumerate(angles):
        shaft = min(max(shaft, angle - true), angle + true)
        estimator.follow(0.05 * i, np.full(3, angle))
        if i % seen_every == 0:
            estimator.observe(0.05 * i, np.full(3, -shaft))
    np.testing.assert_allclose(estimator.half_play_rad, true, atol=1e-3 + 1e-9)


def test_nothing_is_learnt_from_sights_that_are_far_apart() -> None:
    estimator = PlayEstimator(np.full(3, 0.01), 0.7)
    observed(estimator, 0.0, [0.0, 0.1, 0.0, 0.1], every_s=2.0)  # meanwhile the target may have moved
    np.testing.assert_array_equal(estimator.half_play_rad, 0.01)


def test_nothing_is_learnt_across_two_targets() -> None:
    estimator = PlayEstimator(np.full(3, 0.01), 0.7)
    observed(estimator, 0.0, [0.0, 0.1])
    estimator.restart()
    observed(estimator, 0.0, [0.0])
    np.testing.assert_array_equal(estimator.half_play_rad, 0.01)


def test_nothing_is_learnt_from_a_target_that_is_seen_to_move() -> None:
    estimator = PlayEstimator(np.full(3, 0.01), 0.7)
    for i in range(12):
        angle = 0.1 * (i // 3 % 2)  # three sights at each place, past which the target moves on
        estimator.follow(0.05 * i, np.full(3, angle))
        estimator.observe(0.05 * i, np.full(3, 0.004 * i - angle))
    np.testing.assert_array_equal(estimator.half_play_rad, 0.01)


def rests(real: ServoSpec, seed: int, learning: float) -> tuple[float, float]:
    """Return how far aside the eyes are at the end of 3 s, and by how much they still swing [deg]."""
    rig = default_rig()
    random = np.random.default_rng(seed)
    pan, tilt, distance = random.uniform(-0.3, 0.3), random.uniform(-0.2, 0.2), random.uniform(0.4, 1.5)
    place = distance * np.array([math.cos(pan) * math.cos(tilt), math.sin(pan), -math.sin(tilt) * math.cos(pan)])
    servos = {name: real for name, _ in rig.joints.items()}
    head = FakeHead(rig, lambda time_s: place, VisionModel(), seed, servos=servos)
    controller = GazeController(rig, gaze_parameters({"servo.play_learning": learning}), CONTROL_TICKS * TICK_S)
    arrived, aside = [], []
    for tick in range(round(3.0 / TICK_S)):
        arrived += head.advance()
        if tick % CONTROL_TICKS:
            continue
        if tick == 60:
            x, y = head.project(place, left=True)
            controller.look_at(Goal(GoalKind.PIXEL, left_xy=(float(x), float(y)), time_limit_s=60.0), head.time_s)
        command = controller.step(head.time_s, arrived)
        arrived = []
        head.execute(command)
        aside.append(np.degrees(head.true_errors_rad()))
    late = np.array(aside[-40:])
    return float(np.abs(late[:, [0, 2]]).max()), float(np.ptp(late, axis=0).max())


@pytest.mark.parametrize(
    "real",
    [IDEAL, SG90.replaced(dead_band_rad=2.0 * SG90.dead_band_rad), SG90.replaced(speed_rad_s=0.7 * SG90.speed_rad_s)],
    ids=["ideal", "twice_the_dead_band", "slow"],
)
@pytest.mark.parametrize("seed", range(3))
def test_the_eyes_rest_on_the_click_whatever_the_servos_are(real: ServoSpec, seed: int) -> None:
    aside_deg, swing_deg = rests(real, seed, learning=0.7)
    assert aside_deg < 0.2
    assert swing_deg < 0.1


def test_without_learning_ideal_servos_under_an_sg90_description_swing() -> None:
    assert max(rests(IDEAL, seed, learning=0.0)[1] for seed in range(3)) > 0.5
