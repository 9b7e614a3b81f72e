"""Kalman models that are predicted and corrected together do what the textbook's equations do of each alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_gaze.estimation.kalman import KalmanModels, Measurement

ACCELERATIONS, DRIFTS = (0.0, 1.5, 9.0), (0.002, 0.0, 0.0)
BOTH_EYES = np.array([[1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [0.0, 0.0, 1.0]])
DEPTH = np.array([[0.0, 1.0, 0.0]])


def some_models(random: np.random.Generator) -> KalmanModels:
    """Return models with states and covariances as a target in motion leaves them, from sure to vague."""
    models = KalmanModels(ACCELERATIONS, DRIFTS)
    models.states = random.normal(0.0, 0.3, (3, 6))
    roots = random.normal(0.0, 1.0, (3, 6, 6)) * 10.0 ** random.uniform(-4.0, 0.0, (3, 1, 1))
    models.covariances = roots @ roots.transpose(0, 2, 1)
    return models


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 2.0))
def test_a_prediction_is_that_of_each_model_alone(seed: int, duration_s: float) -> None:
    models = some_models(np.random.default_rng(seed))
    before = models.states, models.covariances
    models.predict(duration_s)
    for i, (acceleration, drift) in enumerate(zip(ACCELERATIONS, DRIFTS, strict=True)):
        transition, noise = np.eye(6), np.zeros((6, 6))
        for j, share in ((0, 1.0), (2, 0.25), (4, 1.0)):
            noise[j, j] = drift**2 * duration_s
            if acceleration:
                transition[j, j + 1] = duration_s
                way = np.array([0.5 * duration_s**2, duration_s]) * share * acceleration
                noise[j : j + 2, j : j + 2] += np.outer(way, way)
        np.testing.assert_allclose(models.states[i], transition @ before[0][i], atol=1e-12)
        expected = transition @ before[1][i] @ transition.T + noise
        np.testing.assert_allclose(models.covariances[i], expected, rtol=1e-9, atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([BOTH_EYES, DEPTH]), st.floats(-4.0, -1.0), st.floats(-0.1, 0.4))
def test_a_correction_is_that_of_all_rows_at_once(seed: int, rows: np.ndarray, sigma: float, late_s: float) -> None:
    random = np.random.default_rng(seed)
    models, now_s = some_models(random), 5.0
    stamps = now_s - late_s + np.array([0.0, 0.004, 0.0])[: len(rows)]
    measurement = Measurement(rows, random.normal(0.0, 0.3, len(rows)), np.full(len(rows), 10.0**sigma), stamps)
    states, covariances = models.states, models.covariances
    found = models.innovations(measurement, now_s)
    models.update(found)
    for i, acceleration in enumerate(ACCELERATIONS):
        jacobian = np.zeros((len(rows), 6))
        jacobian[:, 0::2] = rows
        if acceleration:
            jacobian[:, 1::2] = rows * (stamps - now_s)[:, None]
        noise = np.eye(len(rows)) * (10.0 ** (2.0 * sigma) + (0.5 * acceleration * max(late_s - 0.15, 0.0) ** 2) ** 2)
        value = measurement.values - jacobian @ states[i]
        spread = jacobian @ covariances[i] @ jacobian.T + noise
        gain = covariances[i] @ jacobian.T @ np.linalg.inv(spread)
        kept = np.eye(6) - gain @ jacobian
        distance = value @ np.linalg.solve(spread, value)
        np.testing.assert_allclose(found.values[i], value, atol=1e-12)
        assert found.distances[i] == pytest.approx(distance, rel=1e-5)
        assert found.losses[i] == pytest.approx(0.5 * (distance + np.linalg.slogdet(spread)[1]), rel=1e-5, abs=1e-5)
        np.testing.assert_allclose(models.states[i], states[i] + gain @ value, rtol=1e-5, atol=1e-6)
        expected = kept @ covariances[i] @ kept.T + gain @ noise @ gain.T
        np.testing.assert_allclose(models.covariances[i], expected, rtol=1e-4, atol=1e-7 * np.abs(covariances[i]).max())
        assert np.linalg.eigvalsh(models.covariances[i]).min() > -1e-12 * np.abs(covariances[i]).max()
