"""The command of the joints from cycle to cycle: within the limits of the one before, and from where the joints are."""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.joints.limits import CommandLimits
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_LIMITED_RAD = math.radians(1.0)


class SentCommand:
    """The last command in eye angles (3,) [rad], and when it was made."""

    def __init__(self) -> None:
        self.angles_rad: Array | None = None
        """The command, None before the first joint states."""
        self.time_s = math.nan
        self.beyond_limits = False
        """Whether more was desired than the limits allow."""

    def start_at(self, reported_rad: Array, limits: CommandLimits, now_s: float) -> Array:
        """Start the next command from where the joints (3,) are: while none is sent, others may move them."""
        self.angles_rad = nearest = limits.nearest(reported_rad)
        self.time_s = now_s
        return nearest

    def update(
        self, desired_rad: Array, reported_rad: Array, limits: CommandLimits, speed_rad_s: Array, now_s: float
    ) -> Array:
        """Return the command (3,) on the way to the desired angles (3,), NaN for joints that stay."""
        elapsed_s = now_s - self.time_s
        self.angles_rad = limits.limited(desired_rad, self.angles_rad, elapsed_s, reported_rad, speed_rad_s)
        self.time_s = max(now_s, self.time_s)
        return self.angles_rad

    def note_limits(self, desired_rad: Array, limits: CommandLimits) -> None:
        """Record whether the head's own limits allow the desired angles (3,)."""
        desired = [angle if math.isfinite(angle) else 0.0 for angle in desired_rad.tolist()]
        beyond = np.array(desired) - limits.nearest(np.array(desired))
        self.beyond_limits = any(
            abs(off) > _LIMITED_RAD and math.isfinite(angle)
            for off, angle in zip(beyond.tolist(), desired_rad.tolist(), strict=True)
        )

    def describe(self, before: Rig, after: Rig) -> None:
        """Keep the joints where they are under another description of the head."""
        if self.angles_rad is not None:
            self.angles_rad = np.array(after.eye_angles(before.joint_angles(self.angles_rad.tolist())))
