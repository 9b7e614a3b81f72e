"""Software-timed servo pulses by lgpio's tx_servo: any pin of any Pi, 1 us steps, and jitter under load.

The last resort: use kernel_pwm or a PCA9685. The pulses stop with the process, as lgpio makes them in its threads.
"""

import errno
from dataclasses import dataclass
from typing import Any

from vergence_rig.parameters import Parameters, parameter
from vergence_servo.drivers.protocol import Backend, ChannelError, DriverIoError, DriverUnavailableError

_JITTER_WARNING = "backend 'lgpio' times pulses in software: servos jitter under load; kernel_pwm or pca9685 do not"
_PACKAGE = "sudo apt install python3-lgpio"
_GROUP = "sudo usermod -aG gpio $USER, then log in anew"
_LAST_GPIO = 53


@dataclass(frozen=True)
class LgpioParameters(Parameters):
    """Which GPIO chip."""

    chip: int = parameter(
        0, "number N of /dev/gpiochipN; 4 on a Pi 5 with a kernel before 6.6.45", minimum=0, maximum=99, read_only=True
    )
    frequency_hz: int = parameter(
        50, "pulses per second, timed by lgpio", unit="Hz", minimum=40, maximum=500, read_only=True
    )


class LgpioDriver:
    """Pulses on GPIO numbers."""

    outlives_process = False
    resolution_us = 1.0

    def __init__(self, parameters: LgpioParameters | None = None) -> None:
        self._values = parameters or LgpioParameters()
        try:
            import lgpio
        except ImportError as error:
            raise DriverUnavailableError(f"backend 'lgpio': {error}: {_PACKAGE}") from error
        self._lgpio: Any = lgpio
        device = f"/dev/gpiochip{self._values.chip}"
        try:
            self._handle: int | None = lgpio.gpiochip_open(self._values.chip)
        except lgpio.error as error:
            raise DriverUnavailableError(
                f"backend 'lgpio': {device} cannot be opened ({error}): set lgpio.chip to its number; {_GROUP}"
            ) from error
        self._claimed: set[int] = set()

    def set_pulse_us(self, channel: int, pulse_us: float) -> float:
        """See ServoDriver; `channel` is a GPIO number."""
        width_us = round(pulse_us)
        if not 0 <= channel <= _LAST_GPIO:
            raise ChannelError(f"backend 'lgpio': channel must be a GPIO number, 0 to {_LAST_GPIO}: got {channel}")
        if not 500 <= width_us <= 2500:
            raise DriverIoError(errno.EINVAL, f"backend 'lgpio': pulse must be 500 to 2500 us: got {pulse_us}")
        try:
            if channel not in self._claimed:
                self._lgpio.gpio_claim_output(self._handle, channel, 0)
                self._claimed.add(channel)
            self._lgpio.tx_servo(self._handle, channel, width_us, self._values.frequency_hz)
        except self._lgpio.error as error:
            raise DriverIoError(errno.EIO, f"lgpio, GPIO {channel}: {error}") from error
        return float(width_us)

    def release(self, channel: int) -> None:
        """See ServoDriver; the line is given back."""
        if channel not in self._claimed:
            return
        self._claimed.discard(channel)
        try:
            self._lgpio.tx_servo(self._handle, channel, 0, self._values.frequency_hz)
            self._lgpio.gpio_free(self._handle, channel)
        except self._lgpio.error as error:
            raise DriverIoError(errno.EIO, f"lgpio, GPIO {channel}: {error}") from error

    def close(self) -> None:
        """See ServoDriver."""
        for channel in tuple(self._claimed):
            try:
                self.release(channel)
            except DriverIoError:
                continue  # closing the chip below stops its threads anyway
        if self._handle is not None:
            self._lgpio.gpiochip_close(self._handle)
            self._handle = None


BACKEND = Backend("lgpio", LgpioParameters, LgpioDriver, warning=_JITTER_WARNING)
