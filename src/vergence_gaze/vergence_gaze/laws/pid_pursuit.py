"""Coombs and Brown, "Real-time binocular smooth pursuit" (1993): PID pursuit of the centroid, vergence from disparity.

Like theirs it bridges the delay of the images: the target is extrapolated from where it was seen at the speed that the
integral holds, and the error is taken to where the axes are now, not to where they were. The integral is the target's
speed as the eyes have to turn after it, so that a steady ramp is followed without a steady error, and gaze holds
while the rig itself turns. No saccades: a large error is turned to smoothly.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_gaze.joints.servo_inverse import ServoInverse
from vergence_gaze.laws.protocol import ControlInput, target_residual
from vergence_gaze.parameters import GazeParameters
from vergence_rig.parameters import ParameterError, Parameters, parameter
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_MAXIMUM_RESIDUAL_RAD = 1e-3


@dataclass(frozen=True)
class PidPursuitParameters(Parameters):
    """Gains and limits; lists are of version, vergence, tilt."""

    kp: tuple[float, ...] = parameter(
        (10.0, 8.0, 10.0),
        "proportional gains of version, vergence and tilt: joint rate over error",
        unit="1/s",
        minimum=0,
        maximum=100,
    )
    ki: tuple[float, ...] = parameter(
        (25.0, 8.0, 25.0),
        "integral gains of version, vergence and tilt: change of the remembered speed over error and time",
        unit="1/s^2",
        minimum=0,
        maximum=1000,
    )
    kd: tuple[float, ...] = parameter(
        (0.02, 0.0, 0.02),
        "derivative gains of version, vergence and tilt: joint rate over slope of the error",
        minimum=0,
        maximum=10,
    )
    integral_limit_rad_s: float = parameter(
        1.5, "largest speed that the integral can hold", unit="rad/s", minimum=0, maximum=100
    )
    integral_margin_rad_s: float = parameter(
        0.06981317007977318,
        "largest difference of the integral from the speed measured in the images",
        unit="rad/s",
        minimum=0,
        maximum=100,
    )
    integrated_error_rad: float = parameter(
        0.08726646259971647, "error above which nothing is integrated", unit="rad", minimum=0, maximum=3
    )
    windup_limit_rad: float = parameter(
        0.06, "largest distance of the aim from the estimated shaft", unit="rad", minimum=0.001, maximum=1
    )
    rest_play_share: float = parameter(
        0.25,
        "share of the largest servo play, beside servo.hold_tolerance_rad, within which an error at rest is ignored",
        minimum=0,
        maximum=1,
    )
    rest_speed_rad_s: float = parameter(
        0.03, "remembered speed below which small errors are ignored", unit="rad/s", minimum=0, maximum=10
    )
    seen_speed_share: float = parameter(
        0.3, "share of each image's speed in the measured target speed", minimum=0, maximum=1
    )
    jump_speed_rad_s: float = parameter(
        0.7, "change of speed from one image to the next that counts as a jump", unit="rad/s", minimum=0, maximum=100
    )
    stale_after_s: float = parameter(
        0.3, "age of a measurement from which the remembered speed fades instead", unit="s", minimum=0.01, maximum=10
    )
    fade_s: float = parameter(
        0.4, "time constant with which the remembered speed fades", unit="s", minimum=0.01, maximum=10
    )

    def check(self) -> None:
        """Hold the lists to three gains."""
        for name in ("kp", "ki", "kd"):
            gains = getattr(self, name)
            if len(gains) != 3:
                raise ParameterError(name, gains, "three gains: version, vergence, tilt")


class PidPursuitLaw:
    """Rates from errors; no saccades: large errors saturate the speed limit."""

    name = "pid_pursuit"
    Parameters = PidPursuitParameters
    unsigned = False
    lands_at_rest = False

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self._p = p = parameters.of_law(PidPursuitParameters)
        self._kp, self._ki, self._kd = np.array(p.kp), np.array(p.ki), np.array(p.kd)
        self._inverse = ServoInverse(rig, parameters.servo)
        plays = [joint.servo.dead_band_rad + joint.servo.backlash_rad for _, joint in rig.joints.items()]
        self._at_rest_rad = parameters.servo.hold_tolerance_rad + p.rest_play_share * max(plays)
        self.reset()

    def reset(self) -> None:
        """Forget the speed and where the target was."""
        self._inverse.reset()
        self._aim = np.full(3, np.nan)
        self._speed, self._seen_speed = np.zeros(3), np.zeros(3)
        self._place = np.full(3, np.nan)
        self._errors = self._slope = np.zeros(3)
        self._stamp_s = -math.inf

    def compute_command(self, state: ControlInput) -> Array:
        """Return the joint angles (3,) to command."""
        self._update(state)
        age_s = state.now_s + state.lead_s - self._stamp_s
        if not age_s < self._p.stale_after_s:
            # Unseen, gaze goes on for a moment and then holds.
            self._speed = self._speed * math.exp(-state.elapsed_s / self._p.fade_s)
            errors = np.zeros(3)
        else:
            errors = np.nan_to_num(self._place + self._speed * age_s - _axes(state.shaft_rad))
            # At rest, errors within the servos' play are ignored: an integral would oscillate through the play.
            resting = (np.abs(errors) < self._at_rest_rad) & (np.abs(self._speed) < self._p.rest_speed_rad_s)
            errors = np.where(resting, 0.0, errors)
            self._speed = np.where(resting, 0.0, self._speed)
        rates = self._kp * errors + self._speed + self._kd * np.where(errors != 0.0, self._slope, 0.0)
        version, vergence, tilt = rates * state.elapsed_s
        return self._past_the_play(state, state.turned(version, vergence, tilt) - state.commanded_rad)

    def _past_the_play(self, state: ControlInput, turn: Array) -> Array:
        """Return the command (3,) that turns the shafts by `turn` (3,): waiting for the play, the law would wind up."""
        limit_rad = self._p.windup_limit_rad
        before = np.where(np.isfinite(self._aim), self._aim, state.shaft_rad)
        self._aim = np.clip(before + turn, state.shaft_rad - limit_rad, state.shaft_rad + limit_rad)
        return self._inverse.command(self._aim, state.shaft_rad, state.commanded_rad, state.half_play_rad)

    def residual(self, state: ControlInput) -> Array:
        """Return a residual (3,) too small for a saccade: pursuit is smooth whatever the error."""
        return np.clip(target_residual(state), -_MAXIMUM_RESIDUAL_RAD, _MAXIMUM_RESIDUAL_RAD)

    def remaining_rad(self) -> float:
        """Return 0: this law relies on the signed error."""
        return 0.0

    def _update(self, state: ControlInput) -> None:
        visual, p = state.visual, self._p
        if visual is None or visual.stamp_s <= self._stamp_s:
            return
        interval_s = visual.stamp_s - self._stamp_s
        seen = _axes(visual.target_rad)
        if interval_s < p.stale_after_s:
            # What the remembered speed did not predict corrects it; a jump is not a speed.
            errors = np.nan_to_num(seen - (self._place + self._speed * interval_s))
            off = np.nan_to_num(seen + self._speed * (state.now_s - visual.stamp_s) - _axes(state.shaft_rad))
            self._slope = (off - self._errors) / interval_s
            integrates = (np.abs(errors) < p.integrated_error_rad) & (np.abs(off) < p.integrated_error_rad)
            change = np.nan_to_num(seen - self._place) / interval_s - self._seen_speed
            correction = np.where(np.abs(change) < p.jump_speed_rad_s, p.seen_speed_share * change, 0.0)
            self._seen_speed = self._seen_speed + correction
            # On the way to a target at rest the integral would hold its own error for the target's speed.
            speed = np.clip(
                self._speed + np.where(integrates, self._ki * off * interval_s, 0.0),
                self._seen_speed - p.integral_margin_rad_s,
                self._seen_speed + p.integral_margin_rad_s,
            )
            self._speed = np.clip(speed, -p.integral_limit_rad_s, p.integral_limit_rad_s)
            self._errors = off
        else:
            self._speed, self._slope, self._errors = np.zeros(3), np.zeros(3), np.zeros(3)
            self._seen_speed = np.zeros(3)
        self._place = np.where(np.isfinite(seen), seen, self._place + self._speed * min(interval_s, p.stale_after_s))
        self._stamp_s = visual.stamp_s


def _axes(joints_rad: Array) -> Array:
    """Return version, vergence and tilt (3,) of joint angles (3,); one eye's pan alone is the version."""
    left, right, tilt = joints_rad
    version = 0.5 * (left + right) if math.isfinite(left + right) else (left if math.isfinite(left) else right)
    return np.array([version, right - left, tilt])
