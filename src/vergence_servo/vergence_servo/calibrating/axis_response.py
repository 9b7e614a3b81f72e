"""What a servo does with small moves, from commanded pulses and the angles that were seen.

A staircase up and down gives a loop: angle = gain * (pulse - centre) -+ half the lost motion, behind on the side it
came from. Dead band and backlash both lose motion when the direction changes, and at rest nothing tells one from the
other: what is seen is their sum.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vergence_rig.parameters import ParameterError
from vergence_servo.calibration import CalibrationError, ServoCalibration

_LEAST_SAMPLES = 8
_GAINS_RAD_PER_US = (math.radians(0.02), math.radians(0.35))


@dataclass(frozen=True)
class AxisResponse:
    """sign of the gain, its size [rad/us], lost motion (dead band plus backlash) [rad], and how well it fits [rad]."""

    sign: int
    gain_rad_per_us: float
    lost_motion_rad: float
    residual_rad: float
    samples: int


def staircase(amplitude_rad: float, steps: int, loops: int) -> list[float]:
    """Return joint angles about 0 [rad]: down to -amplitude, then up and down in `steps` steps each way, and back."""
    up = np.linspace(-amplitude_rad, amplitude_rad, steps + 1)
    loop = [*up[1:], *up[-2::-1]]
    return [float(angle) for angle in [up[0], *(loop * loops), 0.0]]


def axis_response(pulses_us: Sequence[float], angles_rad: Sequence[float]) -> AxisResponse:
    """Return the servo's response from the pulses sent, in order, and the angle seen after each.

    Args:
        pulses_us: at least 8, with moves in both directions.
        angles_rad: as many; only their differences count.

    Raises:
        CalibrationError: too few samples, no motion seen, or a gain that no servo has.
    """
    pulse, angle = np.asarray(pulses_us, float), np.asarray(angles_rad, float)
    if len(pulse) != len(angle) or len(pulse) < _LEAST_SAMPLES or not np.isfinite([pulse, angle]).all():
        raise CalibrationError(
            f"{len(pulse)} pulses and {len(angle)} angles: allowed are {_LEAST_SAMPLES} or more pairs"
        )
    direction = np.sign(np.diff(pulse, prepend=pulse[0]))
    gain, lost = 0.0, 0.0
    usable = direction != 0
    for _ in range(3):
        # the first moves after a turn are spent on the lost motion: they say nothing of the gain
        usable = (direction != 0) & (_travel_since_turn(pulse) > 1.1 * lost / max(abs(gain), 1e-12))
        if usable.sum() < _LEAST_SAMPLES or len(set(direction[usable])) < 2:
            raise CalibrationError("the moves are too small for this servo's lost motion: make them larger")
        terms = np.column_stack([pulse, np.ones_like(pulse), direction])[usable]
        (gain, _, lag), *_ = np.linalg.lstsq(terms, angle[usable], rcond=None)
        lost = max(-2.0 * lag * np.sign(gain), 0.0)
    fitted = terms @ np.linalg.lstsq(terms, angle[usable], rcond=None)[0]
    residual = float(np.sqrt(np.mean((fitted - angle[usable]) ** 2)))
    low, high = _GAINS_RAD_PER_US
    if not low <= abs(gain) <= high:
        raise CalibrationError(
            f"the eye turned by {math.degrees(gain):+.4f} degrees per us: allowed is {math.degrees(low):.2f} to "
            f"{math.degrees(high):.2f} either way (is the right servo plugged in, and does the camera see enough?)"
        )
    if residual > 0.25 * abs(gain) * float(np.ptp(pulse)):
        raise CalibrationError(
            f"what was seen does not follow the pulses (off by {math.degrees(residual):.2f} degrees)"
        )
    return AxisResponse(int(np.sign(gain)), abs(float(gain)), float(lost), residual, int(usable.sum()))


def _travel_since_turn(pulse: "np.ndarray") -> "np.ndarray":
    travel = np.zeros_like(pulse)
    start = pulse[0]
    for i in range(1, len(pulse)):
        if i > 1 and (pulse[i] - pulse[i - 1]) * (pulse[i - 1] - pulse[i - 2]) < 0:
            start = pulse[i - 1]
        travel[i] = abs(pulse[i] - start)
    # before the first turn nobody knows where the gears lie
    turns = [i for i in range(2, len(pulse)) if (pulse[i] - pulse[i - 1]) * (pulse[i - 1] - pulse[i - 2]) < 0]
    travel[: turns[0] if turns else len(pulse)] = 0.0
    return travel


def calibrated(old: ServoCalibration, response: AxisResponse, offset_rad: float = 0.0) -> ServoCalibration:
    """Return the calibration with the response's sign, gain, dead band and backlash.

    Joint angle 0 stays at its pulse, corrected by `offset_rad`: where the joint really was when it was told 0. Dead
    band and backlash share the lost motion as they do in `old`. Raises CalibrationError.
    """
    centre_us = old.pulse_us(0.0) - response.sign * offset_rad / response.gain_rad_per_us
    known = old.dead_band_rad + old.backlash_rad
    share = old.dead_band_rad / known if known > 0 else 0.5
    reach_rad = math.radians(60.0)
    half_us = reach_rad / response.gain_rad_per_us
    while centre_us - half_us < 300.0 or centre_us + half_us > 2700.0:
        reach_rad, half_us = 0.9 * reach_rad, 0.9 * half_us
        if reach_rad < math.radians(5.0):
            raise CalibrationError(f"joint angle 0 would be at {centre_us:.0f} us: no servo reaches that")
    try:
        return old.replaced(
            angles_rad=(-reach_rad, reach_rad),
            pulses_us=(centre_us - half_us, centre_us + half_us),
            sign=response.sign,
            trim_rad=0.0,
            dead_band_rad=min(share * response.lost_motion_rad, 0.2),
            backlash_rad=min((1 - share) * response.lost_motion_rad, 0.2),
        )
    except ParameterError as error:
        raise CalibrationError(str(error)) from error
