"""What to command so that the shaft ends where it should: the inverse of dead band and backlash.

A hobby servo stops half its dead band short, on the side it came from, and its gears add half their play. Moving on in
the same direction is exact, reversing first crosses the play. So the inverse overdrives by the half play in the
direction of motion, and is slow to reverse: a joint that reversed at every noisy residual would never rest. Two pans
that stay where they are may be off in vergence by as much as both together: the farther one is compared by that, too.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.joints.resolution import pulse_steps_rad
from vergence_gaze.parameters import ServoParameters
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_TURN_SHARE = 0.17
_MOVE_SHARE = 0.12
_STEP_SHARE = 0.6


class ServoInverse:
    """Overdrives each joint (3,) past its play, and leaves errors alone that its smallest step cannot correct."""

    def __init__(self, rig: Rig, parameters: ServoParameters) -> None:
        tolerance_rad = parameters.hold_tolerance_rad
        servos = [joint.servo for _, joint in rig.joints.items()]
        described = np.array([servo.half_play_rad for servo in servos])
        # The next step would be no nearer.
        unresolved = _STEP_SHARE * pulse_steps_rad(rig)
        self._tolerance: list[float] = np.maximum(tolerance_rad + _MOVE_SHARE * described, unresolved).tolist()
        turn_tolerance = np.maximum(tolerance_rad + 2.0 * _TURN_SHARE * described, unresolved)
        self._turn_tolerance: list[float] = turn_tolerance.tolist()
        self._compensation = parameters.play_compensation
        self._direction = [0.0] * 3

    def reset(self) -> None:
        """Forget each joint's last direction: the joints were moved by something else."""
        self._direction = [0.0] * 3

    def command(self, desired_rad: Array, shaft_rad: Array, commanded_rad: Array, half_play_rad: Array) -> Array:
        """Return the command (3,) that brings the shafts to `desired_rad` (3,).

        Args:
            desired_rad: where each shaft should be; one that is not finite leaves its joint alone.
            shaft_rad: where each shaft is estimated to be now.
            commanded_rad: the last command sent.
            half_play_rad: half of each joint's play, as far as it is known.
        """
        command, desired, half_play = commanded_rad.tolist(), desired_rad.tolist(), half_play_rad.tolist()
        errors = [
            want - min(max(shaft, sent - half), sent + half)
            for want, shaft, sent, half in zip(desired, shaft_rad.tolist(), command, half_play, strict=True)
        ]
        farther = int(abs(errors[1]) > abs(errors[0]))
        for i, error in enumerate(errors):
            if not math.isfinite(error):
                continue
            off = max(abs(error), abs(errors[1] - errors[0])) if i == farther else abs(error)
            direction = 1.0 if error > 0 else -1.0
            turning = direction != self._direction[i]
            if off <= (self._turn_tolerance[i] if turning else self._tolerance[i]):
                continue
            self._direction[i] = direction
            # A long way is overdriven in full; a short way back in part: an overestimated play must not overshoot.
            share = self._compensation if turning and abs(error) < 4.0 * half_play[i] else 1.0
            command[i] = desired[i] + direction * half_play[i] * share
        return np.array(command)
