"""The channels that a driver has set pulsing: closing it releases these and no others."""

from collections.abc import Callable
from contextlib import suppress

from vergence_servo.drivers.protocol import DriverIoError


class ChannelsInUse:
    """Writes through `write(channel, value)`, for which 0 means no pulses, and remembers which channels pulse."""

    def __init__(self, write: Callable[[int, int], object]) -> None:
        self._write = write
        self._channels: set[int] = set()

    def set(self, channel: int, value: int) -> None:
        """Write; raises what `write` does, and then what is remembered stays as it was."""
        self._write(channel, value)
        if value:
            self._channels.add(channel)
        else:
            self._channels.discard(channel)

    def release_all(self) -> None:
        """Write 0 to every channel that pulses; one that cannot be reached any more is left as it is."""
        for channel in tuple(self._channels):
            with suppress(DriverIoError):
                self.set(channel, 0)
