"""The target as the filter estimates it at one time: the angles that fixate it, their rates and covariance."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_TO_JOINTS = np.array([[1.0, -0.5, 0.0], [1.0, 0.5, 0.0], [0.0, 0.0, 1.0]])


def joints_of(angles_rad: Array) -> Array:
    """Return pan_left, pan_right, tilt (3,) for version, vergence, tilt (3,)."""
    return np.asarray(_TO_JOINTS @ angles_rad, np.float64)


@dataclass(frozen=True)
class TargetEstimate:
    """The target at one time: angles that fixate it (3,) [rad], rates (3,) [rad/s], covariance of the angles (3, 3)."""

    angles_rad: Array
    rates_rad_s: Array
    covariance: Array
    moving: bool

    @property
    def version_rad(self) -> float:
        """Version that fixates the target."""
        return float(self.angles_rad[0])

    @property
    def vergence_rad(self) -> float:
        """Vergence that fixates the target."""
        return float(self.angles_rad[1])

    @property
    def tilt_rad(self) -> float:
        """Tilt that fixates the target."""
        return float(self.angles_rad[2])

    @cached_property
    def joints_rad(self) -> Array:
        """Joint angles (3,), pan_left, pan_right, tilt, that fixate the target."""
        return joints_of(self.angles_rad)

    @property
    def joint_rates_rad_s(self) -> Array:
        """How fast each joint (3,) turns while it follows the target."""
        return _TO_JOINTS @ self.rates_rad_s

    @cached_property
    def joint_sigmas_rad(self) -> Array:
        """Standard deviations (3,) of the joint angles that fixate the target."""
        return np.asarray(np.sqrt((_TO_JOINTS @ self.covariance @ _TO_JOINTS.T).diagonal()))

    @cached_property
    def sigmas_rad(self) -> Array:
        """Standard deviations of the angles (3,)."""
        return np.asarray(np.sqrt(self.covariance.diagonal()))
