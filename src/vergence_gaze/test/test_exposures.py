"""Which pairs count while the eyes turn, and when two estimators are said to disagree."""

import math

import numpy as np
import pytest

from vergence_gaze.estimation.exposures import Exposures, positive_sigma
from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_rig.rig import JOINT_NAMES, default_rig

PAIR_S = 1.0 / 30.0


def turning(speed_rad_s: float) -> Exposures:
    """Eyes that turn at this speed, reported at 50 Hz from 0 to 1 s."""
    history = ShaftHistory(default_rig())
    for i in range(51):
        history.add(0.02 * i, dict.fromkeys(JOINT_NAMES, speed_rad_s * 0.02 * i))
    return Exposures(gaze_parameters(), history)


def target(rate_rad_s: float, moving: bool = True) -> TargetEstimate:
    return TargetEstimate(np.zeros(3), np.array([rate_rad_s, 0.0, rate_rad_s]), np.eye(3) * 1e-6, moving)


@pytest.mark.parametrize(
    ("eyes_rad_s", "seen", "counts"),
    [
        (0.1, None, True),
        (1.0, None, False),
        (1.0, target(1.0), True),  # they go along with it
        (1.0, target(1.0, moving=False), False),
        (2.5, target(1.0), True),  # they catch up with it
        (10.0, target(1.0), False),  # a saccade
    ],
)
def test_images_count_while_the_eyes_rest_or_go_along(
    eyes_rad_s: float, seen: TargetEstimate | None, counts: bool
) -> None:
    assert turning(eyes_rad_s).were_still(0.5, 0.01, seen) is counts


@pytest.mark.parametrize(("stamp_s", "skew_s"), [(math.nan, 0.0), (0.5, math.inf), (0.5, 0.2), (-1.0, 0.0), (9.0, 0.0)])
def test_stamps_that_mean_nothing_do_not_count(stamp_s: float, skew_s: float) -> None:
    assert not turning(0.0).were_still(stamp_s, skew_s, target(1.0))


def test_a_turning_eye_knows_its_direction_less_well() -> None:
    at_rest, fast = turning(0.0).sigma(0.5, 0.01, 0.001), turning(1.0).sigma(0.5, 0.01, 0.001)
    assert at_rest == pytest.approx(0.001)
    assert 0.003 < fast < 0.01


def test_a_stated_sigma_is_held_to_what_is_sensible() -> None:
    assert [positive_sigma(value, 0.01) for value in (math.nan, -1.0, 0.0, 0.02, 9.0)] == [0.01, 0.01, 0.01, 0.02, 0.5]
