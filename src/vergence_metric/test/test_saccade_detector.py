"""Saccades and rest of the eyes, from their joints alone."""

import math

import pytest

from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.saccade_detector import SaccadeDetector
from vergence_rig.geometry import EyeAngles

FRAME_S = 1 / 30


def turned_over(frames, turn_deg, frame_s=FRAME_S):
    """Return a detector after a rotation of this size over this many frames, the motion then, and the stamp."""
    detector = SaccadeDetector(TrackerParameters())
    stamp_s = 0.0
    for _ in range(10):
        detector.update(stamp_s, EyeAngles(0.0, 0.0, 0.0))
        stamp_s += frame_s
    for k in range(frames):
        state = detector.update(stamp_s, EyeAngles(math.radians(turn_deg * (k + 1) / frames), 0.0, 0.0))
        stamp_s += frame_s
    return detector, state, stamp_s


@pytest.mark.parametrize(("turn_deg", "saccade"), [(2.4, False), (2.6, True)])
@pytest.mark.parametrize("frames", [1, 2])
def test_a_saccade_is_more_than_two_and_a_half_degrees_in_two_frames(turn_deg, saccade, frames):
    detector, state, stamp_s = turned_over(frames, turn_deg)
    assert state.saccading is saccade
    assert state.rested_s == 0.0
    for k in range(4):
        state = detector.update(stamp_s + k * FRAME_S, EyeAngles(math.radians(turn_deg), 0.0, 0.0))
    assert not state.saccading
    assert state.rested_s == pytest.approx(4 * FRAME_S)


def test_pursuit_at_30_degrees_a_second_is_no_saccade():
    detector = SaccadeDetector(TrackerParameters())
    for k in range(60):
        assert not detector.update(k * FRAME_S, EyeAngles(math.radians(30.0 * k * FRAME_S), 0.0, 0.0)).saccading


@pytest.mark.parametrize(
    ("frame_s", "turn_deg", "saccade"), [(0.1, 2.4, False), (0.1, 2.6, True), (0.28, 4.9, False), (0.28, 5.1, True)]
)
def test_a_frame_that_comes_late_is_held_against_the_one_before(frame_s, turn_deg, saccade):
    _, state, _ = turned_over(1, turn_deg, frame_s)
    assert state.saccading is saccade


@pytest.mark.parametrize(("sampled", "jumped"), [(False, False), (True, True)])
def test_a_small_saccade_in_a_long_gap_shows_in_the_samples_between(sampled, jumped):
    detector, after = SaccadeDetector(TrackerParameters()), EyeAngles(math.radians(3.2), 0.0, 0.0)
    detector.update(1.0, EyeAngles(0.0, 0.0, 0.0))
    meanwhile = [(0.9 + 0.02 * k, EyeAngles(0.0, 0.0, 0.0) if k < 9 else after) for k in range(20)]
    state = detector.update(1.25, after, meanwhile if sampled else [])
    assert (state.saccading, state.jumped) == (False, jumped)
    assert not detector.update(1.3, after, meanwhile).jumped


@pytest.mark.parametrize(("follows_deg", "saccade"), [(None, False), (2.4, False), (2.6, True)])
def test_a_jump_that_follows_a_frame_may_have_begun_before_it(follows_deg, saccade):
    detector, ahead = SaccadeDetector(TrackerParameters()), EyeAngles(0.0, 0.0, 0.0)
    detector.update(1.0, ahead)
    follows = [] if follows_deg is None else [(1.045, EyeAngles(0.0, math.radians(follows_deg), 0.0))]
    state = detector.update(1.0 + FRAME_S, ahead, [(1.025, ahead), *follows])
    assert (state.saccading, state.jumped) == (saccade, saccade)
    assert not detector.update(1.0 + 2 * FRAME_S, ahead).saccading


@pytest.mark.parametrize("turned", [(0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)])
def test_any_joint_makes_a_saccade(turned):
    detector = SaccadeDetector(TrackerParameters())
    assert not detector.update(0.0, EyeAngles(0.0, 0.0, 0.0)).saccading
    state = detector.update(FRAME_S, EyeAngles(*turned))
    assert state.saccading
    assert state.jumped
    assert not detector.update(1.0, EyeAngles(*turned)).saccading
