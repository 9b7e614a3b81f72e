"""Kalman filters on the version, vergence and tilt that fixate a target, and what is measured of them.

State (6,): version, its rate, vergence, its rate, tilt, its rate [rad, rad/s], all in the frame of the joints as they
are estimated, so that the estimate is what has to be commanded. Directions measured in one eye are linear in
it, at any distance: the left eye's pan to the target is version - vergence / 2, the right eye's version + vergence / 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

VERSION, VERGENCE, TILT = 0, 2, 4
_DEPTH_SHARE = 0.25
"""Vergence accelerates less than directions do: a quarter of it at 0.5 m already is a metre per second squared."""
_RATE_HOLDS_S = 0.15
"""A measurement later than this gets more noise: the more a target may accelerate, the more."""


@dataclass(frozen=True)
class Measurement:
    """Linear measurements of one pair: row i is coefficients[i] @ state(t) = values[i] +- sigmas[i].

    `coefficients` (n, 3) are for version, vergence, tilt; `stamps_s` (n,) the exposure that each belongs to.
    """

    coefficients: Array
    values: Array
    sigmas: Array
    stamps_s: Array

    @property
    def stamp_s(self) -> float:
        """The pair's stamp: the first row's."""
        return float(self.stamps_s[0])

    def same_kind(self, other: "Measurement") -> bool:
        """Return whether another measurement has the same coefficients."""
        return np.array_equal(self.coefficients, other.coefficients)


class Innovations(NamedTuple):
    """A measurement minus each model's prediction, and what each model estimates with it.

    `values` (m, n) are the differences, `distances` (m,) their squared Mahalanobis distances, `losses` (m,) the
    negative logarithms of the likelihoods without their constant term, `states` (m, 6) and `covariances` (m, 6, 6) the
    corrected estimates.
    """

    values: Array
    distances: Array
    losses: Array
    states: Array
    covariances: Array


class KalmanModels:
    """Several models of one target, which are predicted and updated together.

    A model with an acceleration > 0 has constant velocity with that random acceleration, one with 0 is at rest with
    random walk. Arrays that were read are never changed: a change is a new array.
    """

    def __init__(self, accelerations_rad_s2: Sequence[float], drifts_rad_sqrt_s: Sequence[float]) -> None:
        accelerations = np.array(accelerations_rad_s2)
        count = len(accelerations)
        self._accelerations = accelerations
        self._moves = (accelerations > 0).astype(np.float64)
        self.states = np.zeros((count, 6))
        """The state (6,) of each model."""
        self.covariances = np.zeros((count, 6, 6))
        """The covariance (6, 6) of each model."""
        # The noise of a prediction by the powers of its duration: 1, 2, 3, 4.
        noise = np.zeros((4, count, 6, 6))
        for i, share in ((VERSION, 1.0), (VERGENCE, _DEPTH_SHARE), (TILT, 1.0)):
            variances = np.square(share * accelerations)
            noise[0, :, i, i] = np.square(drifts_rad_sqrt_s)
            noise[1, :, i + 1, i + 1] = variances
            noise[2, :, i, i + 1] = noise[2, :, i + 1, i] = 0.5 * variances
            noise[3, :, i, i] = 0.25 * variances
        self._noise = noise.reshape(4, -1)

    def predict(self, duration_s: float) -> None:
        """Predict the states `duration_s` ahead."""
        turned_s = (duration_s * self._moves)[:, None]
        states, covariances = self.states.copy(), self.covariances.copy()
        states[:, 0::2] += turned_s * states[:, 1::2]
        covariances[:, 0::2] += turned_s[:, None] * covariances[:, 1::2]
        covariances[:, :, 0::2] += turned_s[:, None] * covariances[:, :, 1::2]
        powers = np.array([duration_s, duration_s**2, duration_s**3, duration_s**4])
        noise = (powers @ self._noise).reshape(covariances.shape)
        self.states, self.covariances = states, covariances + noise

    def innovations(self, measurement: Measurement, now_s: float) -> Innovations:
        """Compare a measurement with the states, which are of `now_s`; stamps may be earlier or later than that.

        Rows are independent of one another: each corrects what those before it have left, so that no system of
        equations is to be solved.
        """
        states, covariances = self.states, self.covariances
        jacobians = np.zeros((len(states), len(measurement.values), 6))
        jacobians[:, :, 0::2] = measurement.coefficients
        rates = measurement.coefficients * (measurement.stamps_s - now_s)[:, None]
        jacobians[:, :, 1::2] = self._moves[:, None, None] * rates
        late_s = max(now_s - measurement.stamp_s - _RATE_HOLDS_S, 0.0)
        noises = measurement.sigmas**2 + ((0.5 * late_s**2 * self._accelerations) ** 2)[:, None]
        values = measurement.values - (jacobians @ states[:, :, None])[:, :, 0]
        distances, logarithms = np.zeros(len(states)), np.zeros(len(states))
        for i, value in enumerate(measurement.values.tolist()):
            row = jacobians[:, i]
            crossed = (covariances @ row[:, :, None])[:, :, 0]
            variances = (row * crossed).sum(axis=1) + noises[:, i]
            scaled = crossed / variances[:, None]
            off = value - (row * states).sum(axis=1)
            states = states + scaled * off[:, None]
            covariances = covariances - scaled[:, :, None] * crossed[:, None, :]
            distances = distances + off * off / variances
            logarithms = logarithms + np.log(variances)
        return Innovations(values, distances, 0.5 * (distances + logarithms), states, covariances)

    def update(self, innovations: Innovations) -> None:
        """Correct the states by the measurement of `innovations`."""
        self.states, self.covariances = innovations.states, innovations.covariances
