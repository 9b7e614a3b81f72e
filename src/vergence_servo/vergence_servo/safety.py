"""The pulse that a servo is sent: a pure function of the commanded angle, the last pulse, and the time since.

For every input the result is a finite pulse within the servo's limits, on the backend's grid, and no
further from the last one than the slew limit allows.
"""

import math

from vergence_servo.calibration import ServoLimits

_LONGEST_CREDIT_S = 0.02
"""One pulse period: after a rest, a move starts with what a servo could travel within it, without a jump."""


def safe_pulse_us(
    wanted_rad: float,
    last_us: float,
    elapsed_s: float,
    limits: ServoLimits,
    resolution_us: float,
    speed_rad_s: float = math.inf,
) -> float:
    """Return the pulse to send.

    Args:
        wanted_rad: the commanded joint angle; where it is not finite, the servo stays.
        last_us: the pulse sent last (or assumed, before the first) [us].
        elapsed_s: time since it was sent; negative or NaN counts as none.
        limits: of this servo.
        resolution_us: the backend's grid [us].
        speed_rad_s: a slower limit than the servo's own, if any.

    Returns:
        A multiple of `resolution_us` within the limits, nearest to the angle wanted, unless the slew limit allows
        only part of the way. A `last_us` outside the limits is brought back to them at once.
    """
    lowest, highest = grid_ends(limits, resolution_us)
    inside_us = min(max(last_us, limits.minimum_us), limits.maximum_us) if math.isfinite(last_us) else limits.minimum_us
    last = _clamped(round(inside_us / resolution_us), lowest, highest)
    if not math.isfinite(wanted_rad):
        return _on_limits(last, resolution_us, limits)
    calibration = limits.calibration
    wanted_us = min(max(calibration.pulse_us(wanted_rad), limits.minimum_us), limits.maximum_us)
    wanted = _clamped(round(wanted_us / resolution_us), lowest, highest)
    if wanted == last:
        return _on_limits(last, resolution_us, limits)

    last_rad = calibration.joint_rad(last * resolution_us)
    speed = min(limits.max_speed_rad_s, speed_rad_s if speed_rad_s > 0 else 0.0)
    reach_rad = speed * credit_s(elapsed_s, limits, resolution_us, speed)
    way_rad = calibration.joint_rad(wanted * resolution_us) - last_rad
    if abs(way_rad) > reach_rad:
        # towards the pulse wanted as far as the reach goes, and back to the grid on the near side
        reached = calibration.pulse_us(last_rad + math.copysign(reach_rad, way_rad)) / resolution_us
        wanted = max(math.floor(reached), last) if wanted > last else min(math.ceil(reached), last)
    return _on_limits(_clamped(wanted, lowest, highest), resolution_us, limits)


def credit_s(elapsed_s: float, limits: ServoLimits, resolution_us: float, speed_rad_s: float) -> float:
    """Return the time [s] for which the servo may move now: never more than has passed, nor than a pulse period.

    A servo that needs more than a pulse period for one step of the grid, by its slew limit, may accumulate time for it.
    """
    if not elapsed_s > 0 or speed_rad_s <= 0:
        return 0.0
    return min(elapsed_s, max(_LONGEST_CREDIT_S, 1.001 * limits.calibration.step_rad(resolution_us) / speed_rad_s))


def grid_ends(limits: ServoLimits, resolution_us: float) -> tuple[int, int]:
    """Return the first and last multiple of `resolution_us` within the limits.

    Raises ValueError where the grid is so coarse that there is none.
    """
    lowest, highest = math.ceil(limits.minimum_us / resolution_us), math.floor(limits.maximum_us / resolution_us)
    if lowest > highest:
        raise ValueError(f"resolution_us must have a multiple within the servo's limits: got {resolution_us}")
    return lowest, highest


def _clamped(value: int, lowest: int, highest: int) -> int:
    return min(max(value, lowest), highest)


def _on_limits(steps: int, resolution_us: float, limits: ServoLimits) -> float:
    # the product may be one rounding error outside
    return min(max(steps * resolution_us, limits.minimum_us), limits.maximum_us)
