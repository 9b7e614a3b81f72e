"""Constant-velocity Kalman filters of directions in rig_base, many at once: the eyes' own motion does not enter them.

After Reid and Murray, "Active tracking of foveated feature clusters using affine structure" (1996): one filter for
every corner, in head coordinates. Both axes of a direction have the same noise: one covariance serves both.
"""

import math

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

_COAST_HALF_LIFE_S = 0.7  # the velocity of what is hidden fades: it may have stopped


class DirectionFilter:
    """States of N directions: `angles` (N, 2) [rad], `rates` (N, 2) [rad/s], `covariance` (N, 2, 2) of one axis.

    Args:
        angles: first measurements (N, 2): pan and tilt [rad].
        sigma_rad: standard deviation of a measurement.
        acceleration_rad_s2: of the targets, as white noise over a frame.
        rate_rad_s: standard deviation of the rates at first.
    """

    def __init__(
        self, angles: Points, sigma_rad: float, acceleration_rad_s2: float = 4.0, rate_rad_s: float = 0.3
    ) -> None:
        self._sigma_rad, self._acceleration, self._rate = sigma_rad, acceleration_rad_s2, rate_rad_s
        self.angles, self.rates = angles.copy(), np.zeros_like(angles)
        self.covariance = self._first(len(angles))

    def _first(self, count: int) -> Points:
        return np.tile(np.diag([self._sigma_rad**2, self._rate**2]), (count, 1, 1))

    def predict(self, elapsed_s: float, coasting: bool = False) -> None:
        """Advance all states; those of `coasting` targets, which are not seen, slow down."""
        if coasting:
            decay = math.log(2.0) / _COAST_HALF_LIFE_S
            travelled_s, kept = (1.0 - math.exp(-decay * elapsed_s)) / decay, math.exp(-decay * elapsed_s)
        else:
            travelled_s, kept = elapsed_s, 1.0
        self.angles += travelled_s * self.rates
        self.rates *= kept
        step = np.array([[1.0, travelled_s], [0.0, kept]])
        gain = np.array([0.5 * elapsed_s**2, elapsed_s]) * self._acceleration
        self.covariance = step @ self.covariance @ step.T + np.outer(gain, gain)

    @property
    def sigma_rad(self) -> Points:
        """Standard deviations (N,) of the innovations [rad]."""
        return np.asarray(np.sqrt(self.covariance[:, 0, 0] + self._sigma_rad**2))

    def update(self, which: NDArray[np.intp], angles: Points, eye_sigma_rad: float = 0.0) -> None:
        """Update the states `which` (M,) by measurements (M, 2) of an eye whose reported angle is that uncertain."""
        covariance = self.covariance[which]
        noise = self._sigma_rad**2 + eye_sigma_rad**2
        gain = covariance[:, :, 0] / (covariance[:, 0, 0] + noise)[:, None]
        innovation = angles - self.angles[which]
        self.angles[which] += gain[:, :1] * innovation
        self.rates[which] += gain[:, 1:] * innovation
        self.covariance[which] = covariance - gain[:, :, None] * covariance[:, None, 0, :]

    def restart(self, which: NDArray[np.intp], angles: Points, rates: Points) -> None:
        """Start states anew from measurements (M, 2), with rates (M, 2) or (2,)."""
        self.angles[which], self.rates[which] = angles, rates
        self.covariance[which] = self._first(len(which))

    def append(self, angles: Points, rates: Points) -> None:
        """Add states (M, 2) with rates (2,)."""
        self.angles = np.concatenate([self.angles, angles])
        self.rates = np.concatenate([self.rates, np.broadcast_to(rates, angles.shape)])
        self.covariance = np.concatenate([self.covariance, self._first(len(angles))])

    def keep(self, kept: NDArray[np.bool_]) -> None:
        """Drop the states that are not `kept` (N,)."""
        self.angles, self.rates, self.covariance = self.angles[kept], self.rates[kept], self.covariance[kept]
