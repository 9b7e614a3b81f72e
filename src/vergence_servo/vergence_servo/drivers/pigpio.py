"""Servo pulses from a pigpio daemon, on this Pi or a remote one (Pi 4 and older: pigpio does not run on a Pi 5).

It uses the daemon's socket, 16 bytes each way (pigpio's documentation, "Socket interface"): nothing need be installed
here, and a lost daemon blocks for no longer than `timeout_s`. The daemon goes on pulsing when its client
dies.
"""

import errno
import socket
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from vergence_rig.parameters import Parameters, parameter
from vergence_servo.drivers.channels_in_use import ChannelsInUse
from vergence_servo.drivers.protocol import Backend, ChannelError, DriverIoError, DriverUnavailableError

_SERVO, _REAL_RANGE, _FREQUENCY, _VERSION = 8, 24, 23, 26
_LAST_GPIO = 31
_ERRORS = {
    -2: "not a user GPIO",
    -3: "bad GPIO number",
    -7: "pulse width not 0 or 500 to 2500 us",
    -41: "not permitted on this GPIO (pigpiod -x mask)",
}
_START = "start pigpiod on the Pi (not on a Pi 5); Ubuntu 24.04 has no package of it: docs/servos.md, 'pigpio'"


@dataclass(frozen=True)
class PigpioParameters(Parameters):
    """Where the daemon is."""

    host: str = parameter(
        "localhost", "host of the pigpio daemon; a remote one needs 'pigpiod' without -l", read_only=True
    )
    port: int = parameter(8888, "port of the pigpio daemon", minimum=1, maximum=65535, read_only=True)
    timeout_s: float = parameter(
        0.25, "longest wait for the pigpio daemon's answer", unit="s", minimum=0.01, maximum=10, read_only=True
    )


class PigpioDriver:
    """Pulses on GPIO numbers. A broken connection is made anew by the next write."""

    outlives_process = True

    def __init__(self, parameters: PigpioParameters | None = None) -> None:
        self._values = parameters or PigpioParameters()
        self._socket: socket.socket | None = None
        self._channels = ChannelsInUse(lambda gpio, width_us: self._request(_SERVO, _checked(gpio), width_us))
        try:
            self._request(_VERSION, 0, 0)
            frequency_hz, real_range = self._request(_FREQUENCY, 4, 0), self._request(_REAL_RANGE, 4, 0)
        except OSError as error:
            place = f"{self._values.host}:{self._values.port}"
            raise DriverUnavailableError(f"backend 'pigpio': no daemon at {place} ({error}): {_START}") from error
        # The daemon's sample time (pigpiod -s, 5 us by default) is the step of all pulses.
        self.resolution_us = round(1e6 / (frequency_hz * real_range)) if frequency_hz > 0 and real_range > 0 else 5.0

    def set_pulse_us(self, channel: int, pulse_us: float) -> float:
        """See ServoDriver; `channel` is a GPIO number."""
        width_us = round(round(pulse_us / self.resolution_us) * self.resolution_us)
        if width_us <= 0:
            raise DriverIoError(errno.EINVAL, f"backend 'pigpio': pulse must be more than 0 us: got {pulse_us}")
        self._channels.set(channel, width_us)
        return float(width_us)

    def release(self, channel: int) -> None:
        """See ServoDriver."""
        self._channels.set(channel, 0)

    def close(self) -> None:
        """See ServoDriver."""
        self._channels.release_all()
        self._disconnect()

    def _request(self, command: int, first: int, second: int) -> int:
        try:
            connection = self._connected()
            connection.sendall(struct.pack("<IIII", command, first, second, 0))
            answer = b""
            while len(answer) < 16:
                part = connection.recv(16 - len(answer))
                if not part:
                    raise ConnectionResetError(errno.ECONNRESET, "the daemon closed the connection")
                answer += part
        except OSError as error:
            self._disconnect()
            raise DriverIoError(error.errno or errno.ETIMEDOUT, f"pigpio daemon: {error}") from error
        result: int = struct.unpack("<IIIi", answer)[3]
        if result < 0:
            raise DriverIoError(errno.EINVAL, f"pigpio daemon: GPIO {first}: {_ERRORS.get(result, f'error {result}')}")
        return result

    def _connected(self) -> socket.socket:
        if self._socket is None:
            address = (self._values.host, self._values.port)
            self._socket = socket.create_connection(address, self._values.timeout_s)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return self._socket

    def _disconnect(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None


def _checked(gpio: int) -> int:
    if not 0 <= gpio <= _LAST_GPIO:
        raise ChannelError(f"backend 'pigpio': channel must be a GPIO number, 0 to {_LAST_GPIO}: got {gpio}")
    return gpio


def _hardware(parameters: PigpioParameters, channels: Sequence[int]) -> list[str]:
    return [f"GPIO {channel} of the pigpio daemon at {parameters.host}:{parameters.port}" for channel in channels]


BACKEND = Backend("pigpio", PigpioParameters, PigpioDriver, hardware=_hardware)
