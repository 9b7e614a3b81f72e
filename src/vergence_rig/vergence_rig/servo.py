"""Hobby servos: their data (`ServoSpec`, presets) and their motion (`ServoPlant`).

A hobby servo gives no feedback. Its shaft follows the pulse through six imperfections, each a field of `ServoSpec`:
the pulse comes in steps and late, the motor turns at one speed, it stops as soon as it is inside the dead band (so it
stops short, on the side it came from), and the gears after the potentiometer have backlash.
"""

import math
from collections import deque
from dataclasses import dataclass

from vergence_rig.parameters import Parameters, parameter

_DEG = math.pi / 180.0


@dataclass(frozen=True)
class ServoSpec(Parameters):
    """One kind of servo. `dead_band_rad` and `backlash_rad` are full widths: the shaft may be off by half of each."""

    name: str = parameter("custom", "name of the servo")
    speed_rad_s: float = parameter(
        10.472, "largest speed of the servo without load", unit="rad/s", minimum=1e-3, maximum=1e4
    )
    dead_band_rad: float = parameter(0.0, "full width of the servo's dead band", unit="rad", minimum=0, maximum=0.2)
    pulse_step_rad: float = parameter(
        0.0, "angle of the smallest change of the servo's pulse", unit="rad", minimum=0, maximum=0.5
    )
    backlash_rad: float = parameter(0.0, "full width of the gears' backlash", unit="rad", minimum=0, maximum=0.2)
    command_latency_s: float = parameter(
        0.0, "time from a command to the servo's first motion", unit="s", minimum=0, maximum=1
    )

    @property
    def half_play_rad(self) -> float:
        """Half of dead band and backlash together: how far a shaft at rest may be from its pulse [rad]."""
        return 0.5 * (self.dead_band_rad + self.backlash_rad)

    @property
    def uncertainty_rad(self) -> float:
        """Largest deviation of the shaft from its commanded angle at rest [rad]."""
        return 0.5 * (self.dead_band_rad + self.backlash_rad + self.pulse_step_rad)

    def scaled(self, scale: float) -> "ServoSpec":
        """Return the servo with its angles in another unit: all that are angles times `scale`."""
        return self.replaced(
            speed_rad_s=scale * self.speed_rad_s,
            dead_band_rad=scale * self.dead_band_rad,
            pulse_step_rad=scale * self.pulse_step_rad,
            backlash_rad=scale * self.backlash_rad,
        )


SG90 = ServoSpec(
    name="sg90",
    speed_rad_s=600.0 * _DEG,
    dead_band_rad=0.75 * _DEG,
    pulse_step_rad=0.09 * _DEG,
    backlash_rad=0.3 * _DEG,
    command_latency_s=0.015,
)
"""Tower Pro SG90 at 4.8 V: 0.1 s per 60 degrees, 0.09 degree per us. Data sheets and measurements give a dead band of 5
to 10 us, 0.5 to 0.9 degree: 0.75 in full. Latency: half a 20 ms pulse period and the way to it."""

MG995 = ServoSpec(
    name="mg995",
    speed_rad_s=300.0 * _DEG,
    dead_band_rad=0.45 * _DEG,
    pulse_step_rad=0.09 * _DEG,
    backlash_rad=0.2 * _DEG,
    command_latency_s=0.015,
)
"""Tower Pro MG995 at 4.8 V: 0.2 s per 60 degrees, dead band 5 us, metal gears."""

IDEAL = ServoSpec(name="ideal", speed_rad_s=600.0 * _DEG)
"""A servo as fast as an SG90 without latency, dead band, backlash and steps."""

PRESETS = {spec.name: spec for spec in (SG90, MG995, IDEAL)}
"""The servos that rig.yaml may name."""


class ServoPlant:
    """A servo in motion. Time is the caller's, in seconds, and never decreases.

    >>> plant = ServoPlant(IDEAL, 0.0)
    >>> plant.command(0.1, now_s=0.0)
    >>> plant.step(now_s=1.0)
    0.1
    """

    def __init__(self, spec: ServoSpec, initial_rad: float = 0.0, now_s: float = 0.0) -> None:
        """Start at rest at `initial_rad` with the gears in the middle of their backlash."""
        if not math.isfinite(initial_rad):
            raise ValueError(f"initial_rad must be a finite angle [rad]: got {initial_rad!r}")
        self.spec = spec
        self._now_s = now_s
        self._pending: deque[tuple[float, float]] = deque()
        self._commanded_rad = self._pulse_rad = initial_rad
        self._modelled_rad = self._motor_rad = self._shaft_rad = initial_rad
        self._velocity_rad_s = 0.0

    @property
    def true_rad(self) -> float:
        """True angle of the output shaft [rad]."""
        return self._shaft_rad

    @property
    def modelled_rad(self) -> float:
        """A driver's estimate without feedback: the command after its latency, at the servo's speed [rad]."""
        return self._modelled_rad

    @property
    def velocity_rad_s(self) -> float:
        """The motor's speed at the end of the last step [rad/s]."""
        return self._velocity_rad_s

    @property
    def at_rest(self) -> bool:
        """True if `modelled_rad` stays as it is until the next command."""
        return not self._pending and self._modelled_rad == self._commanded_rad

    def command(self, angle_rad: float, now_s: float) -> None:
        """Command an angle [rad] at `now_s`; raises ValueError for one that is not finite."""
        if not math.isfinite(angle_rad):
            raise ValueError(f"angle_rad must be a finite angle [rad]: got {angle_rad!r}")
        self._pending.append((max(now_s, self._now_s) + self.spec.command_latency_s, angle_rad))

    def step(self, now_s: float) -> float:
        """Move on to `now_s` and return the true angle [rad]; an earlier time changes nothing."""
        while self._pending and self._pending[0][0] <= now_s:
            effective_s, angle_rad = self._pending.popleft()
            self._move(effective_s)
            self._commanded_rad = angle_rad
            step_rad = self.spec.pulse_step_rad
            self._pulse_rad = round(angle_rad / step_rad) * step_rad if step_rad > 0 else angle_rad
        self._move(now_s)
        return self._shaft_rad

    def _move(self, until_s: float) -> None:
        reach_rad = self.spec.speed_rad_s * (until_s - self._now_s)
        if reach_rad <= 0:
            return
        duration_s, self._now_s = until_s - self._now_s, until_s
        self._modelled_rad = _approach(self._modelled_rad, self._commanded_rad, reach_rad)
        before_rad = self._motor_rad
        error_rad = self._pulse_rad - self._motor_rad
        half_band_rad = 0.5 * self.spec.dead_band_rad
        if abs(error_rad) > half_band_rad:
            near_edge_rad = self._pulse_rad - math.copysign(half_band_rad, error_rad)
            self._motor_rad = _approach(self._motor_rad, near_edge_rad, reach_rad)
        self._velocity_rad_s = (self._motor_rad - before_rad) / duration_s
        half_backlash_rad = 0.5 * self.spec.backlash_rad
        self._shaft_rad = min(
            max(self._shaft_rad, self._motor_rad - half_backlash_rad), self._motor_rad + half_backlash_rad
        )


def _approach(position: float, goal: float, reach: float) -> float:
    return goal if abs(goal - position) <= reach else position + math.copysign(reach, goal - position)
