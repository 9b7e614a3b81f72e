"""A Kalman filter on the version, vergence and tilt that fixate a target, and what is measured of them.

State (6,): version, its rate, vergence, its rate, tilt, its rate [rad, rad/s], all in the frame of the joints as they
are estimated, so that what the filter says is what has to be commanded. Directions measured in one eye are linear in
it, at any distance: the left eye's pan to the target is version - vergence / 2, the right eye's version + vergence / 2.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

VERSION, VERGENCE, TILT = 0, 2, 4
_DEPTH_SHARE = 0.25
"""Vergence accelerates less than directions do: a quarter of it at 0.5 m already is a metre per second squared."""
_RATE_HOLDS_S = 0.15
"""A measurement that is later than this is believed the less, the more a target may change its speed."""


@dataclass(frozen=True)
class Measurement:
    """Linear measurements of one pair: row i says coefficients[i] @ state(t) = values[i] +- sigmas[i].

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

    def alike(self, other: "Measurement") -> bool:
        """Tell whether another measurement is of the same kind."""
        return np.array_equal(self.coefficients, other.coefficients)


@dataclass(frozen=True)
class Fit:
    """How a model met a measurement: design (n, 6), innovation (n,), its covariance (n, n) and squared distance.

    `noise` (n,) are the measurement's variances, as far as this model can believe it.
    """

    design: Array
    innovation: Array
    noise: Array
    spread: Array
    distance: float

    @property
    def loss(self) -> float:
        """Negative logarithm of the likelihood, but for a constant."""
        return 0.5 * (self.distance + math.log(np.linalg.det(self.spread)))


class Kalman:
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

    def advance(self, duration_s: float) -> None:
        """Predict the state `duration_s` ahead."""
        transition = np.eye(6)
        noise = np.zeros((6, 6))
        for i, acceleration in self._accelerations.items():
            noise[i, i] = self._drift**2 * duration_s
            if self.moves:
                transition[i, i + 1] = duration_s
                gain = np.array([0.5 * duration_s**2, duration_s]) * acceleration
                noise[i : i + 2, i : i + 2] += np.outer(gain, gain)
        self.state = transition @ self.state
        self.covariance = transition @ self.covariance @ transition.T + noise

    def fit(self, measurement: Measurement, now_s: float) -> Fit:
        """Hold a measurement against the state, which is of `now_s`: stamps may be earlier or later than that."""
        design = np.zeros((len(measurement.values), 6))
        design[:, 0::2] = measurement.coefficients
        if self.moves:
            design[:, 1::2] = measurement.coefficients * (measurement.stamps_s - now_s)[:, None]
        noise = measurement.sigmas**2
        late_s = now_s - measurement.stamp_s - _RATE_HOLDS_S
        if self.moves and late_s > 0:
            noise = noise + (0.5 * self._accelerations[VERSION] * late_s**2) ** 2
        spread = design @ self.covariance @ design.T + np.diag(noise)
        innovation = measurement.values - design @ self.state
        return Fit(design, innovation, noise, spread, float(innovation @ np.linalg.solve(spread, innovation)))

    def correct(self, fit: Fit) -> None:
        """Take the measurement that `fit` is of."""
        gain = np.linalg.solve(fit.spread, fit.design @ self.covariance).T
        self.state = self.state + gain @ fit.innovation
        # Joseph's form: the short one loses its positive variances where a certain measurement meets a vague prior.
        kept = np.eye(6) - gain @ fit.design
        self.covariance = kept @ self.covariance @ kept.T + (gain * fit.noise) @ gain.T
