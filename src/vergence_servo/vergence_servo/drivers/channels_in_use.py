"""The channels on which a driver sends pulses: closing it releases these and no others."""

from collections.abc import Callable
from contextlib import suppress

from vergence_servo.drivers.protocol import DriverIoError


class ChannelsInUse:
    """Writes through `write(channel, value)`, where 0 means no pulses, and records which channels pulse."""

    def __init__(self, write: Callable[[int, int], object]) -> None:
        self._write = write
        self._channels: set[int] = set()

    def set(self, channel: int, value: int) -> None:
        """Write; raises what `write` does, and then the record stays unchanged."""
        self._write(channel, value)
        if value:
            self._channels.add(channel)
        else:
            self._channels.discard(channel)

    def release_all(self) -> None:
        """Write 0 to every channel that pulses; one whose write fails is skipped."""
        for channel in tuple(self._channels):
            with suppress(DriverIoError):
                self.set(channel, 0)
