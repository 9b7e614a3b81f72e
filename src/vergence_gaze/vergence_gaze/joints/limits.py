"""Safety as a pure function: from the desired joint angles and the last command to the command that is sent."""

import math

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

LONGEST_STEP_S = 0.1
"""After a longer pause of the controller, one command moves the joints no farther than for this time."""

_MARGIN_RAD = 1e-9


class CommandLimits:
    """Joint, speed and minimum-vergence limits of a rig's commands. Angles are (3,): pan_left, pan_right, tilt [rad].

    `minimum_vergence_rad` is the rig's least one less the described play of both pans.
    """

    def __init__(self, rig: Rig) -> None:
        joints = [joint for _, joint in rig.joints.items()]
        self.lower_rad = np.array([joint.lower_rad for joint in joints])
        self.upper_rad = np.array([joint.upper_rad for joint in joints])
        self.speed_rad_s = np.array([joint.speed_rad_s for joint in joints])
        # The eyes' vergence is limited, not that of the commands: a shaft stays behind its command by half its play,
        # and commands that may not diverge by that could not turn the eyes to anything far away.
        play_rad = sum(pan.servo.half_play_rad for pan in joints[:2])
        self.minimum_vergence_rad = rig.least_vergence_rad - play_rad

    def nearest(self, angles_rad: Array) -> Array:
        """Return the angles nearest to `angles_rad` that the limits allow: finite ones are expected."""
        allowed: Array = np.minimum(np.maximum(angles_rad, self.lower_rad), self.upper_rad)
        lacking = self.minimum_vergence_rad + _MARGIN_RAD - (allowed[1] - allowed[0])
        if lacking > 0:
            allowed[0] = max(allowed[0] - 0.5 * lacking, self.lower_rad[0])
            allowed[1] = min(allowed[0] + self.minimum_vergence_rad + _MARGIN_RAD, self.upper_rad[1])
            allowed[0] = min(allowed[0], allowed[1] - self.minimum_vergence_rad - _MARGIN_RAD)
        return allowed

    def allows(self, angles_rad: Array, tolerance_rad: float = 1e-12) -> bool:
        """Return whether the joint and vergence limits hold."""
        return bool(
            np.isfinite(angles_rad).all()
            and (angles_rad >= self.lower_rad - tolerance_rad).all()
            and (angles_rad <= self.upper_rad + tolerance_rad).all()
            and angles_rad[1] - angles_rad[0] >= self.minimum_vergence_rad - tolerance_rad
        )

    def limited(
        self,
        desired_rad: Array,
        last_rad: Array | None,
        elapsed_s: float,
        present_rad: Array,
        speed_rad_s: Array | None = None,
    ) -> Array:
        """Return the command (3,) to send.

        Args:
            desired_rad: desired angles (3,); joints that are not finite stay where they are.
            last_rad: the last command sent, or None before the first, which is the nearest allowed to `present_rad`.
            elapsed_s: time since the last command; nothing moves if it is not a positive number.
            present_rad: where the joints are reported (3,), finite.
            speed_rad_s: largest speeds (3,); the joints' own if none.
        """
        if last_rad is None:
            return self.nearest(present_rad)
        if not (math.isfinite(elapsed_s) and elapsed_s > 0):
            return last_rad
        desired = self.nearest(np.where(np.isfinite(desired_rad), desired_rad, last_rad))
        reach = (self.speed_rad_s if speed_rad_s is None else speed_rad_s) * min(elapsed_s, LONGEST_STEP_S)
        move = np.minimum(np.maximum(desired - last_rad, -reach), reach)
        # The pans may arrive one after the other: the one that lessens the vergence waits for the other at the limit.
        excess = move[0] - move[1] - (last_rad[1] - last_rad[0] - self.minimum_vergence_rad)
        lessening = max(move[0], 0.0) + max(-move[1], 0.0)
        if excess > 0 and lessening > 0:
            share = max(lessening - excess, 0.0) / lessening
            move[0] *= share if move[0] > 0 else 1.0
            move[1] *= share if move[1] < 0 else 1.0
        limited: Array = np.minimum(np.maximum(last_rad + move, self.lower_rad), self.upper_rad)
        return limited
