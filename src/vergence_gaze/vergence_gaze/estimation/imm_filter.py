"""A target in motion: one that keeps its speed and one that manoeuvres, mixed by how well each explains what is seen.

Blom and Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian switching coefficients"
(1988). A calm model alone loses a target that swings; a lively one alone shakes the eyes with the images' noise.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.kalman import Fit, Kalman, Measurement

Array = npt.NDArray[np.float64]

_CALM_FOR_S = 2.0
_MANOEUVRES_FOR_S = 0.3
_LEAST_WEIGHT = 1e-3


class Motion:
    """Two models of constant velocity, calm and manoeuvring, with their weights (2,)."""

    def __init__(self, calm_rad_s2: float, manoeuvre_rad_s2: float) -> None:
        self.modes = (Kalman(calm_rad_s2, 0.0), Kalman(max(calm_rad_s2, manoeuvre_rad_s2), 0.0))
        self.weights = _sensible(np.array([1.0, 0.0]))

    def start(self, state: Array, covariance: Array, weights: tuple[float, float] = (1.0, 0.0)) -> None:
        """Begin both models at a state (6,) with its covariance (6, 6)."""
        for mode in self.modes:
            mode.state, mode.covariance = state.copy(), covariance.copy()
        self.weights = _sensible(np.array(weights))

    def mixed(self) -> tuple[Array, Array]:
        """Return mean (6,) and covariance (6, 6) of both together."""
        return self._moments(self.weights)

    def advance(self, duration_s: float) -> None:
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
            mode.advance(duration_s)
        self.weights = _sensible(weights)

    def fits(self, measurement: Measurement, now_s: float) -> tuple[Fit, Fit]:
        """Hold a measurement against both models."""
        calm, manoeuvring = self.modes
        return calm.fit(measurement, now_s), manoeuvring.fit(measurement, now_s)

    def loss(self, fits: tuple[Fit, Fit]) -> float:
        """Return the negative logarithm of the mixture's likelihood, but for a constant."""
        losses = np.array([fit.loss for fit in fits])
        least = float(losses.min())
        return least - math.log(float(self.weights @ np.exp(least - losses)) + 1e-12)

    def correct(self, fits: tuple[Fit, Fit]) -> None:
        """Take the measurement that `fits` are of."""
        losses = np.array([fit.loss for fit in fits])
        weights = self.weights * np.exp(losses.min() - losses)
        for mode, fit in zip(self.modes, fits, strict=True):
            mode.correct(fit)
        self.weights = _sensible(weights / max(float(weights.sum()), 1e-300))

    def _moments(self, weights: Array) -> tuple[Array, Array]:
        one, other = self.modes
        apart = one.state - other.state
        state = weights[0] * one.state + weights[1] * other.state
        covariance = weights[0] * one.covariance + weights[1] * other.covariance
        return state, covariance + weights[0] * weights[1] * np.outer(apart, apart)


def _sensible(weights: Array) -> Array:
    """Return weights (2,) that sum to one, none of them nothing: the other model may be right any time."""
    held = np.maximum(weights, _LEAST_WEIGHT)
    shares: Array = held / held.sum()
    return shares
