"""Distance and its interval: covariance by numbers, parallel axes, and what the visual encoder adds."""

import math
from dataclasses import replace

import numpy as np
import pytest

from vergence_gaze.estimation.distance import joint_variances, target_position
from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.estimation.vergence_offset import VergenceOffset
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
from vergence_rig.testing.ideal_eyes import gaze_for_point

RIG = default_rig()
HEAD = Kinematics(RIG)
NOTHING = np.zeros(3)


def estimate(distance_m: float, sigma_rad: float = 1e-4) -> TargetEstimate:
    eyes = gaze_for_point((distance_m, 0.0, 0.0), RIG.baseline_m)
    angles = np.array([eyes.version_rad, eyes.vergence_rad, eyes.tilt_rad])
    return TargetEstimate(angles, NOTHING, np.eye(3) * sigma_rad**2, False)


def test_half_a_degree_is_13_cm_at_one_metre() -> None:
    variances = np.array([0.5, 0.5, 0.0]) * math.radians(0.5) ** 2  # together half a degree of vergence
    position = target_position(estimate(1.0), HEAD, variances)
    assert position.distance_m == pytest.approx(1.0, abs=1e-6)
    assert math.sqrt(position.covariance_m2[0, 0]) == pytest.approx(0.134, abs=0.002)


def test_covariance_agrees_with_sampling() -> None:
    random, variances = np.random.default_rng(1), joint_variances(RIG)
    centre = estimate(0.6)
    stated = target_position(centre, HEAD, variances).covariance_m2
    points = []
    for left, right, tilt in random.normal(0.0, np.sqrt(variances), (4000, 3)):
        angles = centre.angles_rad + np.array([0.5 * (left + right), right - left, tilt])
        points.append(target_position(TargetEstimate(angles, NOTHING, np.eye(3) * 1e-12, False), HEAD, NOTHING).point_m)
    np.testing.assert_allclose(np.diag(stated), np.var(points, axis=0), rtol=0.15)


def test_parallel_axes_cannot_be_excluded_far_away() -> None:
    position = target_position(estimate(40.0), HEAD, joint_variances(RIG))
    assert math.isinf(position.high_m)
    assert position.low_m < 40.0
    assert (
        target_position(TargetEstimate(NOTHING, NOTHING, np.eye(3) * 1e-8, False), HEAD, NOTHING).distance_m == math.inf
    )


def test_the_visual_encoder_narrows_the_interval_until_a_pan_moves() -> None:
    variances = joint_variances(RIG)
    offset = VergenceOffset(variances)
    before = target_position(estimate(1.0), HEAD, variances, offset)
    for i in range(20):
        assert offset.update(1.0 + i, 0.002, 0.0004)
    after = target_position(estimate(1.0), HEAD, variances, offset)
    assert offset.offset_rad == pytest.approx(0.002, rel=0.15)
    assert after.high_m - after.low_m < 0.6 * (before.high_m - before.low_m)
    assert after.distance_m < before.distance_m  # converging more than the joints say is nearer
    offset.on_pan_moved(100.0)
    assert not offset.update(99.0, 0.002, 0.0004)
    assert target_position(estimate(1.0), HEAD, variances, offset).distance_m == pytest.approx(before.distance_m)


def test_a_baseline_known_to_one_percent_gives_distances_known_to_one_percent() -> None:
    head = Kinematics(replace(RIG, baseline_sigma_m=0.01 * RIG.baseline_m))
    for distance_m in (0.3, 1.5):
        position = target_position(estimate(distance_m, sigma_rad=1e-6), head, NOTHING)
        assert position.high_m - position.low_m == pytest.approx(2 * 1.8 * 0.01 * distance_m, rel=0.05)
