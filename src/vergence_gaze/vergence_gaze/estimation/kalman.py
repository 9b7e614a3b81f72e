"""A Kalman filter on the version, vergence and tilt that fixate a target, and what is measured of them.

State (6,): version, its rate, vergence, its rate, tilt, its rate [rad, rad/s], all in the frame of the joints as they
are estimated, so that the estimate is what has to be commanded. Directions measured in one eye are linear in
it, at any distance: the left eye's pan to the target is version - vergence / 2, the right eye's version + vergence / 2.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

VERSION, VERGENCE, TILT = 0, 2, 4
_IDENTITY = np.eye(6)
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


@dataclass(frozen=True)
class Innovation:
    """A measurement minus a model's prediction: `value` (n,) with its `covariance` (n, n).

    `jacobian` (n, 6) is of the measurement by the state, `noise` (n,) the measurement's variances for this model, and
    `distance` the squared Mahalanobis distance.
    """

    jacobian: Array
    value: Array
    noise: Array
    covariance: Array
    distance: float

    @cached_property
    def negative_log_likelihood(self) -> float:
        """Negative logarithm of the likelihood, without its constant term."""
        return 0.5 * (self.distance + math.log(np.linalg.det(self.covariance)))


class KalmanFilter:
    """One model. `acceleration` > 0: constant velocity with that random acceleration; 0: at rest with random walk."""

    def __init__(self, acceleration_rad_s2: float, drift_rad_sqrt_s: float) -> None:
        self._accelerations = {
            VERSION: acceleration_rad_s2,
            VERGENCE: _DEPTH_SHARE * acceleration_rad_s2,
            TILT: acceleration_rad_s2,
        }
        self.moves = acceleration_rad_s2 > 0
        self._drift = drift_rad_sqrt_s
        self.state = np.zeros(6)
        self.covariance = np.zeros((6, 6))

    def predict(self, duration_s: float) -> None:
        """Predict the state `duration_s` ahead."""
        transition = _IDENTITY.copy()
        noise = np.zeros((6, 6))
        for i, acceleration in self._accelerations.items():
            noise[i, i] = self._drift**2 * duration_s
            if self.moves:
                transition[i, i + 1] = duration_s
                angle, rate = 0.5 * duration_s**2 * acceleration, duration_s * acceleration
                noise[i, i] += angle * angle
                noise[i, i + 1] = noise[i + 1, i] = angle * rate
                noise[i + 1, i + 1] = rate * rate
        self.state = transition @ self.state
        self.covariance = transition @ self.covariance @ transition.T + noise

    def innovation(self, measurement: Measurement, now_s: float) -> Innovation:
        """Compare a measurement with the state, which is of `now_s`; stamps may be earlier or later than that."""
        jacobian = np.zeros((len(measurement.values), 6))
        jacobian[:, 0::2] = measurement.coefficients
        if self.moves:
            jacobian[:, 1::2] = measurement.coefficients * (measurement.stamps_s - now_s)[:, None]
        noise = measurement.sigmas**2
        late_s = now_s - measurement.stamp_s - _RATE_HOLDS_S
        if self.moves and late_s > 0:
            noise = noise + (0.5 * self._accelerations[VERSION] * late_s**2) ** 2
        covariance = jacobian @ self.covariance @ jacobian.T
        covariance.flat[:: len(noise) + 1] += noise
        value = measurement.values - jacobian @ self.state
        distance = float(value @ np.linalg.solve(covariance, value))
        return Innovation(jacobian, value, noise, covariance, distance)

    def update(self, innovation: Innovation) -> None:
        """Correct the state by the measurement of `innovation`."""
        gain = np.linalg.solve(innovation.covariance, innovation.jacobian @ self.covariance).T
        self.state = self.state + gain @ innovation.value
        # Joseph's form: the short one loses its positive variances where a certain measurement meets a vague prior.
        kept = _IDENTITY - gain @ innovation.jacobian
        self.covariance = kept @ self.covariance @ kept.T + (gain * innovation.noise) @ gain.T
