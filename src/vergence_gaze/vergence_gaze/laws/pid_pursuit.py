"""Coombs and Brown, "Real-time binocular smooth pursuit" (1993): PID pursuit of the centroid, vergence from disparity.

Like theirs it bridges the delay of the images: the target is taken from where it was seen on along the speed that the
integral remembers, and the error is held against where the axes are now, not against where they were. The integral is
the target's speed as the eyes have to turn after it, so that a steady ramp is followed without a steady error, and gaze
holds just so while the rig itself turns. No saccades: what is far off is turned to smoothly.
"""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.joints.servo_inverse import ServoInverse
from vergence_gaze.laws.protocol import LawView, target_residual
from vergence_gaze.parameters import GazeParameters
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

# version, vergence, tilt
_PROPORTIONAL = np.array([10.0, 8.0, 10.0])
_INTEGRAL = np.array([25.0, 8.0, 25.0])
_DERIVATIVE = np.array([0.02, 0.0, 0.02])
_FASTEST_RAD_S = 1.5
_INTEGRATED_RAD = math.radians(5.0)
_PLAY_SHARE = 0.25
_SLOW_RAD_S = 0.03
_FADE_S = 0.4
_STALE_S = 0.3
_FARTHEST_RAD = 0.06
_SEEN_SHARE = 0.3
_JUMP_RAD_S = 0.7
_BESIDE_RAD_S = math.radians(4.0)


class PidPursuitLaw:
    """Rates from errors; no saccades: large errors saturate the speed limit."""

    name = "pid_pursuit"
    unsigned = False
    lands_at_rest = False

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._inverse = ServoInverse(rig, parameters.hold_tolerance_rad, parameters.dead_band_trust)
        plays = [joint.servo.dead_band_rad + joint.servo.backlash_rad for _, joint in rig.joints.items()]
        self._at_rest_rad = parameters.hold_tolerance_rad + _PLAY_SHARE * max(plays)
        self.reset()

    def reset(self) -> None:
        """Forget the speed and where the target was."""
        self._inverse.reset()
        self._aim = np.full(3, np.nan)
        self._speed, self._seen_speed = np.zeros(3), np.zeros(3)
        self._place = np.full(3, np.nan)
        self._errors = self._slope = np.zeros(3)
        self._stamp_s = -math.inf

    def wanted(self, view: LawView) -> Array:
        """Return the joint angles (3,) to command."""
        self._take(view)
        age_s = view.now_s + view.lead_s - self._stamp_s
        if not age_s < _STALE_S:
            # Unseen, gaze goes on for a moment and then holds.
            self._speed = self._speed * math.exp(-view.elapsed_s / _FADE_S)
            errors = np.zeros(3)
        else:
            errors = np.nan_to_num(self._place + self._speed * age_s - _axes(view.shaft_rad))
            # At rest, what the servos' play cannot mend is left alone: an integral would swing through it for ever.
            resting = (np.abs(errors) < self._at_rest_rad) & (np.abs(self._speed) < _SLOW_RAD_S)
            errors = np.where(resting, 0.0, errors)
            self._speed = np.where(resting, 0.0, self._speed)
        rates = _PROPORTIONAL * errors + self._speed + _DERIVATIVE * np.where(errors != 0.0, self._slope, 0.0)
        version, vergence, tilt = rates * view.elapsed_s
        return self._past_the_play(view, view.turned(version, vergence, tilt) - view.commanded_rad)

    def _past_the_play(self, view: LawView, turn: Array) -> Array:
        """Return the command (3,) that turns the shafts by `turn` (3,): waiting for the play, the law would wind up."""
        before = np.where(np.isfinite(self._aim), self._aim, view.shaft_rad)
        self._aim = np.clip(before + turn, view.shaft_rad - _FARTHEST_RAD, view.shaft_rad + _FARTHEST_RAD)
        return self._inverse.command(self._aim, view.shaft_rad, view.commanded_rad)

    def residual(self, view: LawView) -> Array:
        """Return next to nothing: pursuit is smooth whatever the error, there is nothing to saccade for."""
        return np.clip(target_residual(view), -1e-3, 1e-3)

    def remaining_rad(self) -> float:
        """Return 0: the signed error says it."""
        return 0.0

    def _take(self, view: LawView) -> None:
        visual = view.visual
        if visual is None or visual.stamp_s <= self._stamp_s:
            return
        interval_s = visual.stamp_s - self._stamp_s
        seen = _axes(visual.target_rad)
        if interval_s < _STALE_S:
            # What the remembered speed did not foretell corrects it; a jump is not a speed.
            errors = np.nan_to_num(seen - (self._place + self._speed * interval_s))
            off = np.nan_to_num(seen + self._speed * (view.now_s - visual.stamp_s) - _axes(view.shaft_rad))
            self._slope = (off - self._errors) / interval_s
            learns = (np.abs(errors) < _INTEGRATED_RAD) & (np.abs(off) < _INTEGRATED_RAD)
            surprise = np.nan_to_num(seen - self._place) / interval_s - self._seen_speed
            self._seen_speed = self._seen_speed + np.where(np.abs(surprise) < _JUMP_RAD_S, _SEEN_SHARE * surprise, 0.0)
            # On the way to a target at rest the integral would take its own error for the target's speed.
            speed = np.clip(
                self._speed + np.where(learns, _INTEGRAL * off * interval_s, 0.0),
                self._seen_speed - _BESIDE_RAD_S,
                self._seen_speed + _BESIDE_RAD_S,
            )
            self._speed = np.clip(speed, -_FASTEST_RAD_S, _FASTEST_RAD_S)
            self._errors = off
        else:
            self._speed, self._slope, self._errors = np.zeros(3), np.zeros(3), np.zeros(3)
            self._seen_speed = np.zeros(3)
        self._place = np.where(np.isfinite(seen), seen, self._place + self._speed * min(interval_s, _STALE_S))
        self._stamp_s = visual.stamp_s


def _axes(joints_rad: Array) -> Array:
    """Return version, vergence and tilt (3,) of joint angles (3,); one eye's pan alone is the version."""
    left, right, tilt = joints_rad
    version = 0.5 * (left + right) if math.isfinite(left + right) else (left if math.isfinite(left) else right)
    return np.array([version, right - left, tilt])
