"""The filter of the target: at rest, calmly moving, manoeuvring, jumping."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_gaze.estimation.imm_filter import ImmWeights
from vergence_gaze.estimation.kalman import KalmanModels, Measurement
from vergence_gaze.estimation.target_filter import TargetFilter

ROWS = np.array([[1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [0.0, 0.0, 1.0]])
DEPTH = np.array([[0.0, 1.0, 0.0]])
SIGMA = 0.0008
INTERVAL_S = 1.0 / 30.0
Place = Callable[[float], tuple[float, float, float]]


def filter_at(start: tuple[float, float, float], manoeuvre_rad_s2: float = 8.0) -> TargetFilter:
    target = TargetFilter(1.0, manoeuvre_rad_s2, 0.002, 4.5, 2)
    target.initialise(0.0, np.array(start), np.eye(3) * 1e-4)
    return target


def seen(place: tuple[float, float, float], time_s: float, noise: np.ndarray) -> Measurement:
    return Measurement(ROWS, ROWS @ np.array(place) + noise, np.full(3, SIGMA), np.full(3, time_s))


def followed(place: Place, until_s: float, manoeuvre_rad_s2: float = 8.0, ahead_s: float = 0.08) -> np.ndarray:
    """Return the errors (n,) [rad] of the version predicted `ahead_s`, from 1 s on."""
    random = np.random.default_rng(5)
    target, errors = filter_at(place(0.0), manoeuvre_rad_s2), []
    for i in range(1, int(until_s / INTERVAL_S)):
        time_s = i * INTERVAL_S
        measurement = seen(place(time_s), time_s, random.normal(0.0, SIGMA, 3))
        if not target.update(measurement):
            target.accept_jump(measurement)
        if time_s > 1.0:
            errors.append(target.at(time_s + ahead_s).version_rad - place(time_s + ahead_s)[0])
    return np.array(errors)


def swing(time_s: float) -> tuple[float, float, float]:
    return math.radians(10.0) * math.sin(math.tau * max(time_s - 0.5, 0.0)), 0.08, 0.0


def test_at_rest_noise_does_not_move_it() -> None:
    errors = followed(lambda time_s: (0.1, 0.08, 0.0), 4.0)
    assert np.abs(errors).max() < 1.5 * SIGMA
    assert np.std(errors) < 0.6 * SIGMA


def test_a_steady_speed_is_predicted() -> None:
    errors = followed(lambda time_s: (0.35 * max(time_s - 0.5, 0.0), 0.08, 0.0), 3.0)
    assert np.median(np.abs(errors)) < math.radians(0.3)


def test_a_swing_of_one_hertz_is_followed_and_not_without_a_model_for_it() -> None:
    with_it, without = followed(swing, 4.0), followed(swing, 4.0, manoeuvre_rad_s2=1.0)
    assert np.median(np.abs(with_it)) < math.radians(1.2)
    assert np.abs(with_it).max() < math.radians(3.5)
    assert np.median(np.abs(with_it)) < 0.7 * np.median(np.abs(without))


def test_one_outlier_is_refused_and_two_that_agree_are_a_jump() -> None:
    target = filter_at((0.0, 0.08, 0.0))
    for i in range(1, 20):
        assert target.update(seen((0.0, 0.08, 0.0), i * INTERVAL_S, np.zeros(3)))
    first, second = (seen((0.3, 0.05, 0.1), i * INTERVAL_S, np.zeros(3)) for i in (20, 21))
    assert not target.update(first)
    assert not target.accept_jump(first)
    assert target.at(first.stamp_s).version_rad == pytest.approx(0.0, abs=1e-4)
    assert not target.update(second)
    assert target.accept_jump(second)
    np.testing.assert_allclose(target.at(second.stamp_s).angles_rad, (0.3, 0.05, 0.1), atol=1e-3)


def test_a_jump_onto_something_that_moves_takes_its_speed() -> None:
    target = filter_at((0.0, 0.08, 0.0))
    for i in range(1, 30):
        time_s = i * INTERVAL_S
        place = (0.0, 0.08, 0.0) if i < 20 else (0.3 + 1.0 * (time_s - 20 * INTERVAL_S), 0.08, 0.0)
        measurement = seen(place, time_s, np.zeros(3))
        if not target.update(measurement):
            target.accept_jump(measurement)
        if i == 24:
            assert target.at(time_s).rates_rad_s[0] == pytest.approx(1.0, abs=0.15)


def jumped(steps: tuple[tuple[float, float], ...], sigma: float = SIGMA) -> TargetFilter:
    """Return a filter that knew a target at rest, after sightings at (version, s since it was last there)."""
    target = filter_at((0.0, 0.08, 0.0))
    for i in range(1, 20):
        target.update(seen((0.0, 0.08, 0.0), i * INTERVAL_S, np.zeros(3)))
    for version, later_s in steps:
        time_s = 19 * INTERVAL_S + later_s
        place = np.array([version, 0.08, 0.0])
        measurement = Measurement(ROWS, ROWS @ place, np.full(3, sigma), np.full(3, time_s))
        if not target.update(measurement):
            target.accept_jump(measurement)
    return target


def test_two_sightings_that_go_on_are_of_a_target_on_its_way() -> None:
    target = jumped(((0.3, 0.05), (0.33, 0.1)))
    assert target.moving
    assert target.at(19 * INTERVAL_S + 0.1).rates_rad_s[0] == pytest.approx(0.6, abs=0.06)


@pytest.mark.parametrize(
    ("steps", "sigma"),
    [
        (((0.05, 0.1), (0.05, 0.2)), SIGMA),  # it has jumped
        (((0.05, 0.1), (0.053, 0.2)), SIGMA),  # the same, with noise
        (((0.3, 0.1), (0.32, 0.2)), 0.02),  # as far apart as that sighting's noise
        (((0.05, 0.1), (0.058, 0.104)), SIGMA),  # two measurements of one pair
    ],
)
def test_two_sightings_of_one_place_are_of_a_target_at_rest(
    steps: tuple[tuple[float, float], ...], sigma: float
) -> None:
    target = jumped(steps, sigma)
    assert not target.moving
    assert target.at(19 * INTERVAL_S + 0.2).version_rad == pytest.approx(steps[-1][0], abs=max(0.01, 2.0 * sigma))


def test_a_depth_alone_that_goes_on_is_no_motion() -> None:
    target = filter_at((0.1, 0.08, 0.0))
    for i in range(1, 6):
        target.update(seen((0.1, 0.08, 0.0), i * INTERVAL_S, np.zeros(3)))
    for i, vergence in ((6, 0.12), (7, 0.13)):
        measurement = Measurement(DEPTH, np.array([vergence]), np.array([SIGMA]), np.array([i * INTERVAL_S]))
        assert not target.update(measurement)
    assert target.accept_jump(measurement)
    assert not target.moving


@pytest.mark.parametrize("rate_hz", [20.0, 30.0])
def test_a_start_at_full_speed_is_detected_within_four_pairs(rate_hz: float) -> None:
    random = np.random.default_rng(8)
    target, begun_s = filter_at((0.0, 0.08, 0.0)), 2.0
    for i in range(1, int(3.0 * rate_hz)):
        time_s = i / rate_hz
        gone_s = max(time_s - begun_s, 0.0)
        measurement = seen((math.radians(20.0) * gone_s, 0.08, 0.0), time_s, random.normal(0.0, SIGMA, 3))
        if not target.update(measurement):
            target.accept_jump(measurement)
        assert not (target.moving and gone_s == 0.0)
        if gone_s >= 4.0 / rate_hz:
            assert target.moving


def test_a_depth_alone_moves_the_right_eye_only() -> None:
    target = filter_at((0.1, 0.08, 0.0))
    for i in range(1, 6):
        target.update(seen((0.1, 0.08, 0.0), i * INTERVAL_S, np.zeros(3)))
    left_before = target.at(0.2).joints_rad[0]
    for i in (6, 7):
        measurement = Measurement(DEPTH, np.array([0.12]), np.array([SIGMA]), np.array([i * INTERVAL_S]))
        assert not target.update(measurement)
    assert target.accept_jump(measurement)
    assert target.at(0.24).vergence_rad == pytest.approx(0.12, abs=1e-3)
    assert target.at(0.24).joints_rad[0] == pytest.approx(left_before, abs=1e-3)


def test_joint_sigmas_are_of_the_joints() -> None:
    target = filter_at((0.1, 0.08, 0.0))
    target.inflate_covariance(np.array([4e-4, 0.0, 0.0]))
    left, right, tilt = target.at(0.0).joint_sigmas_rad
    assert left == pytest.approx(math.sqrt(1.25e-4 + 4e-4), rel=1e-6)
    assert right == pytest.approx(math.sqrt(1.25e-4), rel=1e-6)
    assert tilt == pytest.approx(0.01, rel=1e-6)


def test_weights_follow_what_is_seen() -> None:
    models, mixture = KalmanModels((1.0, 8.0), (0.0, 0.0)), ImmWeights()
    models.covariances = np.array([np.eye(6) * 1e-4] * 2)

    def see(version_rad: float, time_s: float) -> float:
        models.states, models.covariances = mixture.mixed(models.states, models.covariances, INTERVAL_S)
        models.predict(INTERVAL_S)
        innovations = models.innovations(seen((version_rad, 0.0, 0.0), time_s, np.zeros(3)), time_s)
        models.update(innovations)
        mixture.update(innovations.losses)
        assert sum(mixture.weights) == pytest.approx(1.0)
        return mixture.weights[1]

    for i in range(1, 20):
        weight = see(0.0, i * INTERVAL_S)
    assert weight < 0.1
    place, speed = 0.0, 0.0
    for i in range(20, 24):
        speed += 7.0 * INTERVAL_S
        place += speed * INTERVAL_S
        weight = see(place, i * INTERVAL_S)
    assert weight > 0.7


@settings(deadline=None, max_examples=40)
@given(
    st.lists(
        st.tuples(st.floats(-0.05, 0.2), st.floats(-1.0, 1.0), st.floats(0.0, 0.3), st.booleans()),
        min_size=1,
        max_size=25,
    )
)
def test_whatever_is_seen_the_estimate_stays_finite_and_its_covariance_positive(
    sightings: list[tuple[float, float, float, bool]],
) -> None:
    target, time_s = filter_at((0.0, 0.08, 0.0)), 0.0
    for later_s, version, vergence, whole in sightings:
        time_s += later_s
        if whole:
            measurement = seen((version, vergence, 0.5 * version), time_s, np.zeros(3))
        else:
            measurement = Measurement(DEPTH, np.array([vergence]), np.array([SIGMA]), np.array([time_s]))
        if not target.update(measurement):
            target.accept_jump(measurement)
        estimate = target.at(time_s + 0.1)
        assert np.isfinite(estimate.angles_rad).all()
        assert np.linalg.eigvalsh(estimate.covariance).min() > 0
