"""Slower limits of commands, with a bounded acceleration: eyes that start and stop smoothly."""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.joints.limits import LONGEST_STEP_S, CommandLimits
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]


class SmoothLimits(CommandLimits):
    """The rig's limits, at most `speed_rad_s` fast, which changes by at most `acceleration_rad_s2`."""

    def __init__(self, rig: Rig, speed_rad_s: float, acceleration_rad_s2: float) -> None:
        super().__init__(rig)
        self._rig_speed_rad_s, self._acceleration_rad_s2 = self.speed_rad_s, acceleration_rad_s2
        self.use_speed(speed_rad_s)
        self.restart()

    def use_speed(self, speed_rad_s: float) -> None:
        """Limit the joints to another speed, or to the rig's where that is lower."""
        self.speed_rad_s = np.minimum(self._rig_speed_rad_s, speed_rad_s)

    def restart(self) -> None:
        """Start from rest."""
        self._rate_rad_s = np.zeros(3)

    def limited(
        self,
        desired_rad: Array,
        last_rad: Array | None,
        elapsed_s: float,
        present_rad: Array,
        speed_rad_s: Array | None = None,
    ) -> Array:
        """See CommandLimits."""
        speed = self.speed_rad_s if speed_rad_s is None else np.minimum(self.speed_rad_s, speed_rad_s)
        if last_rad is None or not (math.isfinite(elapsed_s) and elapsed_s > 0):
            self.restart()
            return super().limited(desired_rad, last_rad, elapsed_s, present_rad)
        elapsed_s = min(elapsed_s, LONGEST_STEP_S)
        desired = self.nearest(np.where(np.isfinite(desired_rad), desired_rad, last_rad))
        off = desired - last_rad
        change = self._acceleration_rad_s2 * elapsed_s
        # The greatest speed from which a joint that slows down evenly stops at the desired angle.
        stopping = np.sqrt(change**2 + 2.0 * self._acceleration_rad_s2 * np.abs(off)) - change
        wanted = np.sign(off) * np.minimum(stopping, speed)
        rate = np.clip(wanted, self._rate_rad_s - change, self._rate_rad_s + change)
        sent = super().limited(last_rad + rate * elapsed_s, last_rad, elapsed_s, present_rad)
        self._rate_rad_s = (sent - last_rad) / elapsed_s
        return sent
