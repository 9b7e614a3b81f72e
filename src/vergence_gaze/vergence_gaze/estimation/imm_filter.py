"""A target in motion: a calm and a manoeuvring model, combined by the likelihood of each (IMM).

Blom and Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian switching coefficients"
(1988). A calm model alone loses a target that swings; a manoeuvring one alone passes the images' noise on to the eyes.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.kalman import Innovation, KalmanFilter, Measurement

Array = npt.NDArray[np.float64]

_CALM_FOR_S = 2.0
_MANOEUVRES_FOR_S = 0.3
_LEAST_WEIGHT = 1e-3


class ImmFilter:
    """Two models of constant velocity, calm and manoeuvring, with their weights (2,)."""

    def __init__(self, calm_rad_s2: float, manoeuvre_rad_s2: float) -> None:
        self.modes = (KalmanFilter(calm_rad_s2, 0.0), KalmanFilter(max(calm_rad_s2, manoeuvre_rad_s2), 0.0))
        self.weights = _normalised(np.array([1.0, 0.0]))

    def initialise(self, state: Array, covariance: Array, weights: tuple[float, float] = (1.0, 0.0)) -> None:
        """Start both models at a state (6,) with its covariance (6, 6)."""
        for mode in self.modes:
            mode.state, mode.covariance = state.copy(), covariance.copy()
        self.weights = _normalised(np.array(weights))

    def combined(self) -> tuple[Array, Array]:
        """Return mean (6,) and covariance (6, 6) of both models together."""
        return self._moments(self.weights)

    def predict(self, duration_s: float) -> None:
        """Predict `duration_s` ahead: the longer, the likelier that the target has begun or ended a manoeuvre."""
        begins, ends = 1.0 - math.exp(-duration_s / _CALM_FOR_S), 1.0 - math.exp(-duration_s / _MANOEUVRES_FOR_S)
        switch = np.array([[1.0 - begins, begins], [ends, 1.0 - ends]])
        # Column j: from where a target that is now in mode j came.
        origins = switch * self.weights[:, None]
        weights = origins.sum(axis=0)
        origins = origins / weights
        starts = [self._moments(origins[:, j]) for j in range(2)]
        for mode, (state, covariance) in zip(self.modes, starts, strict=True):
            mode.state, mode.covariance = state, covariance
            mode.predict(duration_s)
        self.weights = _normalised(weights)

    def innovations(self, measurement: Measurement, now_s: float) -> tuple[Innovation, Innovation]:
        """Return the innovation of a measurement in both models."""
        calm, manoeuvring = self.modes
        return calm.innovation(measurement, now_s), manoeuvring.innovation(measurement, now_s)

    def negative_log_likelihood(self, innovations: tuple[Innovation, Innovation]) -> float:
        """Return the negative logarithm of the mixture's likelihood, without its constant term."""
        losses = np.array([innovation.negative_log_likelihood for innovation in innovations])
        least = float(losses.min())
        return least - math.log(float(self.weights @ np.exp(least - losses)) + 1e-12)

    def update(self, innovations: tuple[Innovation, Innovation]) -> None:
        """Correct both models by the measurement of `innovations`, and weight them by their likelihood."""
        losses = np.array([innovation.negative_log_likelihood for innovation in innovations])
        weights = self.weights * np.exp(losses.min() - losses)
        for mode, innovation in zip(self.modes, innovations, strict=True):
            mode.update(innovation)
        self.weights = _normalised(weights / max(float(weights.sum()), 1e-300))

    def _moments(self, weights: Array) -> tuple[Array, Array]:
        one, other = self.modes
        apart = one.state - other.state
        first, second = weights.tolist()
        state = first * one.state + second * other.state
        covariance = first * one.covariance + second * other.covariance
        return state, covariance + first * second * (apart[:, None] * apart)


def _normalised(weights: Array) -> Array:
    """Return weights (2,) that sum to one, none of them zero: the other model may be right at any time."""
    held = np.maximum(weights, _LEAST_WEIGHT)
    shares: Array = held / held.sum()
    return shares
