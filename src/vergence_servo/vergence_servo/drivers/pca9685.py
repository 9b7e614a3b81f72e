"""A PCA9685 on I2C through Adafruit's library: 16 channels, 4.88 us steps at 50 Hz (0.44 degree on an SG90).

The chip goes on pulsing when the process dies, and even when the Pi is switched off while the servos' supply is not:
wire its OE pin (docs/servos.md).
"""

import errno
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from vergence_rig.install_hint import install_hint
from vergence_rig.parameters import Parameters, parameter
from vergence_servo.drivers.channels_in_use import ChannelsInUse
from vergence_servo.drivers.protocol import Backend, ChannelError, DriverIoError, DriverUnavailableError

_CHANNELS = 16
_TICKS = 4096
_I2C = "enable I2C: dtparam=i2c_arm=on in /boot/firmware/config.txt, reboot"
_GROUP = "sudo usermod -aG i2c $USER, then log in anew"


@dataclass(frozen=True)
class Pca9685Parameters(Parameters):
    """Where the chip is and how fast it runs."""

    address: int = parameter(0x40, "I2C address of the PCA9685", minimum=0x40, maximum=0x7F, read_only=True)
    frequency_hz: float = parameter(
        50.0, "pulses per second of the PCA9685", unit="Hz", minimum=24, maximum=400, read_only=True
    )
    oscillator_hz: float = parameter(
        25.0e6,
        "true frequency of the PCA9685's oscillator; specimens have 23 to 27 MHz",
        unit="Hz",
        minimum=2e7,
        maximum=3e7,
        read_only=True,
    )


class Pca9685Driver:
    """Pulses from one chip. `bus` is a Blinka I2C bus; left out, the board's own is opened."""

    outlives_process = True

    def __init__(self, parameters: Pca9685Parameters | None = None, bus: Any = None) -> None:
        values = parameters or Pca9685Parameters()
        try:
            from adafruit_pca9685 import PCA9685
        except ImportError as error:
            raise DriverUnavailableError(f"backend 'pca9685': {error}: {_packages()}") from error
        self._chip = _open(PCA9685, _board_bus() if bus is None else bus, values)
        self._channels = ChannelsInUse(self._write)
        # The true step: the prescaler is a whole number.
        self.resolution_us = (int(self._chip.prescale_reg) + 1) / values.oscillator_hz * 1e6

    def set_pulse_us(self, channel: int, pulse_us: float) -> float:
        """See ServoDriver."""
        ticks = round(pulse_us / self.resolution_us)
        if not 0 < ticks < _TICKS:
            raise DriverIoError(
                errno.EINVAL, f"pulse must be 1 to {_TICKS - 1} ticks: got {pulse_us} us, {ticks} ticks"
            )
        self._channels.set(channel, ticks)
        return ticks * self.resolution_us

    def release(self, channel: int) -> None:
        """See ServoDriver; sets the chip's full-off bit."""
        self._channels.set(channel, 0)

    def close(self) -> None:
        """See ServoDriver. The chip's other channels are left alone; where the bus is gone, only OE can stop them."""
        self._channels.release_all()

    def _write(self, channel: int, ticks: int) -> None:
        if not 0 <= channel < _CHANNELS:
            raise ChannelError(f"backend 'pca9685': channel must be 0 to {_CHANNELS - 1}: got {channel}")
        try:
            self._chip.channels[channel].duty_cycle = ticks << 4  # the library's scale is 16 bits, the chip's 12
        except (OSError, RuntimeError) as error:
            number = error.errno if isinstance(error, OSError) and error.errno else errno.EIO
            raise DriverIoError(number, f"PCA9685 channel {channel}: {error}") from error


def _packages() -> str:
    return f"sudo apt install python3-libgpiod, and {install_hint('adafruit-circuitpython-pca9685')}"


def _board_bus() -> Any:
    try:
        import board

        return board.I2C()
    except ImportError as error:
        raise DriverUnavailableError(f"backend 'pca9685': {error}: {_packages()}") from error
    except PermissionError as error:
        raise DriverUnavailableError(f"backend 'pca9685': {error}: {_GROUP}") from error
    except (NotImplementedError, AttributeError, OSError, ValueError, RuntimeError) as error:
        raise DriverUnavailableError(f"backend 'pca9685': no I2C bus ({error}): {_I2C}") from error


def _open(library: Any, bus: Any, values: Pca9685Parameters) -> Any:
    try:
        chip = library(bus, address=values.address, reference_clock_speed=round(values.oscillator_hz))
        chip.frequency = values.frequency_hz
    except PermissionError as error:
        raise DriverUnavailableError(f"backend 'pca9685': {error}: {_GROUP}") from error
    except (OSError, ValueError, RuntimeError) as error:
        raise DriverUnavailableError(
            f"backend 'pca9685': no answer at address {values.address:#04x} ({error}): check wiring and power, "
            f"look with 'i2cdetect -y 1'"
        ) from error
    return chip


def _hardware(parameters: Pca9685Parameters, channels: Sequence[int]) -> list[str]:
    # The whole chip: opening it sets the frequency of all its channels.
    return [f"PCA9685 at address 0x{parameters.address:02X}"]


BACKEND = Backend("pca9685", Pca9685Parameters, Pca9685Driver, hardware=_hardware)
