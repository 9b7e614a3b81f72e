"""A servo's response to small moves, from the pulses sent and the angles seen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from vergence_calibration.lost_motion import LoopError, fit_loop
from vergence_rig.parameters import ParameterError
from vergence_servo.calibration import ServoCalibration, ServoCalibrationError

_GAINS_RAD_PER_US = (math.radians(0.02), math.radians(0.35))


@dataclass(frozen=True)
class AxisResponse:
    """Sign and size of the gain [rad/us], lost motion (dead band plus backlash) [rad], and RMS residual [rad]."""

    sign: int
    gain_rad_per_us: float
    lost_motion_rad: float
    residual_rad: float
    samples: int


def axis_response(pulses_us: Sequence[float], angles_rad: Sequence[float]) -> AxisResponse:
    """Return the servo's response from the pulses sent, in order, and the angle seen after each.

    Args:
        pulses_us: at least 8, with moves in both directions.
        angles_rad: as many; only their differences count.

    Raises:
        ServoCalibrationError: too few samples, no motion seen, or a gain that no servo has.
    """
    try:
        loop = fit_loop(pulses_us, angles_rad)
    except LoopError as error:
        raise ServoCalibrationError(str(error)) from error
    low, high = _GAINS_RAD_PER_US
    if not low <= abs(loop.gain) <= high:
        raise ServoCalibrationError(
            f"the eye must turn by {math.degrees(low):.2f} to {math.degrees(high):.2f} degrees per us in either "
            f"direction: got {math.degrees(loop.gain):+.4f} (is the right servo plugged in, and the scene textured?)"
        )
    if loop.residual > 0.25 * abs(loop.gain) * (max(pulses_us) - min(pulses_us)):
        raise ServoCalibrationError(
            f"the eye does not follow the pulses (residual {math.degrees(loop.residual):.2f} degrees)"
        )
    return AxisResponse(1 if loop.gain > 0 else -1, abs(loop.gain), loop.lost, loop.residual, loop.samples)


def calibrated(old: ServoCalibration, response: AxisResponse, offset_rad: float = 0.0) -> ServoCalibration:
    """Return the calibration with the response's sign, gain, dead band and backlash.

    Joint angle 0 stays at its pulse, corrected by `offset_rad`: the joint's true angle when it was commanded to 0. Dead
    band and backlash share the lost motion as they do in `old`. Raises ServoCalibrationError.
    """
    centre_us = old.pulse_us(0.0) - response.sign * offset_rad / response.gain_rad_per_us
    known = old.dead_band_rad + old.backlash_rad
    share = old.dead_band_rad / known if known > 0 else 0.5
    reach_rad = math.radians(60.0)
    half_us = reach_rad / response.gain_rad_per_us
    while centre_us - half_us < 300.0 or centre_us + half_us > 2700.0:
        reach_rad, half_us = 0.9 * reach_rad, 0.9 * half_us
        if reach_rad < math.radians(5.0):
            raise ServoCalibrationError(f"joint angle 0 must be within a servo's pulses: got {centre_us:.0f} us")
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
        raise ServoCalibrationError(str(error)) from error
