"""When the eyes are in a saccade and when they rest, from their joints alone."""

import math

import pytest

from vergence_metric.eye_watch import EyeWatch
from vergence_metric.fovea_parameters import TrackerParameters
from vergence_rig.geometry import EyeAngles

FRAME_S = 1 / 30


@pytest.mark.parametrize(("turn_deg", "saccade"), [(3.9, False), (4.2, True)])
def test_a_saccade_is_more_than_four_degrees_in_a_tenth_of_a_second(turn_deg, saccade):
    watch = EyeWatch(TrackerParameters())
    for k in range(10):
        watch.update(k * FRAME_S, EyeAngles(0.0, 0.0, 0.0))
    for k in range(3):
        state = watch.update((10 + k) * FRAME_S, EyeAngles(math.radians(turn_deg * (k + 1) / 3), 0.0, 0.0))
    assert state.saccading is saccade
    assert state.rested_s == 0.0
    for k in range(4):
        state = watch.update((13 + k) * FRAME_S, EyeAngles(math.radians(turn_deg), 0.0, 0.0))
    assert not state.saccading
    assert state.rested_s == pytest.approx(4 * FRAME_S)


@pytest.mark.parametrize("turned", [(0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)])
def test_any_joint_makes_a_saccade(turned):
    watch = EyeWatch(TrackerParameters())
    assert not watch.update(0.0, EyeAngles(0.0, 0.0, 0.0)).saccading
    assert watch.update(FRAME_S, EyeAngles(*turned)).saccading
    assert not watch.update(1.0, EyeAngles(*turned)).saccading
