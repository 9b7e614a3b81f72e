"""A driver without hardware: it simulates servos that travel at a limited speed."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from vergence_rig.banner import banner
from vergence_rig.parameters import Parameters, parameter
from vergence_servo.drivers.protocol import Backend, ChannelError, on_grid

_WARNING = banner(
    "NO SERVO MOVES: this head runs on fake servos",
    "backend 'fake': no servo moves; set 'backend' and 'servos' for a real head (docs/servos.md)",
)


@dataclass(frozen=True)
class FakeParameters(Parameters):
    """The simulated hardware."""

    resolution_us: float = parameter(1.0, "smallest change of a simulated pulse", unit="us", minimum=0.001, maximum=100)
    channels: int = parameter(16, "number of simulated channels", minimum=1, maximum=64)
    speed_us_s: float = parameter(
        6667.0,
        "speed at which a simulated servo follows its pulse; the default is an SG90's",
        unit="us/s",
        minimum=1,
        maximum=1e9,
    )


@dataclass
class _Servo:
    pulse_us: float | None = None
    position_us: float = 1500.0
    moved_s: float = 0.0


class FakeDriver:
    """Servos whose positions, in microseconds of pulse, follow at a limited speed; limp ones stay where they are."""

    outlives_process = False

    def __init__(self, parameters: FakeParameters | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._parameters = parameters or FakeParameters()
        self._clock = clock
        self._servos = {number: _Servo(moved_s=clock()) for number in range(self._parameters.channels)}
        self.closed = False

    @property
    def resolution_us(self) -> float:
        """The smallest change of the pulse [us]."""
        return self._parameters.resolution_us

    def set_pulse_us(self, channel: int, pulse_us: float) -> float:
        """Send the servo on its way; see ServoDriver."""
        servo = self._servo(channel)
        self._travel(servo)
        servo.pulse_us = on_grid(pulse_us, self.resolution_us)
        return servo.pulse_us

    def release(self, channel: int) -> None:
        """Let the servo go limp where it is."""
        servo = self._servo(channel)
        self._travel(servo)
        servo.pulse_us = None

    def close(self) -> None:
        """Release all."""
        for channel in self._servos:
            self.release(channel)
        self.closed = True

    def pulse_us(self, channel: int) -> float | None:
        """The pulse that is being sent [us]; None if released."""
        return self._servo(channel).pulse_us

    def position_us(self, channel: int) -> float:
        """Where the servo is now, as the pulse that would hold it there [us]."""
        servo = self._servo(channel)
        self._travel(servo)
        return servo.position_us

    def _servo(self, channel: int) -> _Servo:
        if channel not in self._servos:
            raise ChannelError(f"backend 'fake': channel must be 0 to {len(self._servos) - 1}: got {channel}")
        return self._servos[channel]

    def _travel(self, servo: _Servo) -> None:
        now_s = self._clock()
        reach_us = self._parameters.speed_us_s * max(0.0, now_s - servo.moved_s)
        servo.moved_s = now_s
        if servo.pulse_us is not None:
            way_us = servo.pulse_us - servo.position_us
            servo.position_us += math.copysign(min(abs(way_us), reach_us), way_us)


BACKEND = Backend("fake", FakeParameters, FakeDriver, moves_servos=False, warning=_WARNING)
