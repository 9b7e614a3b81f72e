"""What every servo backend does, and the ways in which one can fail."""

from typing import Protocol


class DriverUnavailableError(ValueError):
    """A backend that cannot be opened here. Its text names the package, group or device-tree line that mends it."""


class ChannelError(ValueError):
    """A channel that the backend does not have."""


class DriverIoError(OSError):
    """A write that failed while running; a later one may succeed."""


class ServoDriver(Protocol):
    """Pulses on numbered channels.

    Pulse widths lie on a grid: whole multiples of `resolution_us`. A driver writes the multiple nearest to what it is
    given and returns it. No driver clamps or limits anything else: that is the task of `vergence_servo.safety`.
    """

    @property
    def resolution_us(self) -> float:
        """The real smallest change of the pulse [us]."""

    @property
    def outlives_process(self) -> bool:
        """True if the hardware goes on pulsing when this process dies."""

    def set_pulse_us(self, channel: int, pulse_us: float) -> float:
        """Send pulses of this width [us] from now on and return the width really sent.

        Raises:
            ChannelError: no such channel.
            DriverIoError: the hardware did not take it.
        """

    def release(self, channel: int) -> None:
        """Stop the pulses, so that the servo goes limp. Releasing a released channel does nothing. Raises as above."""

    def close(self) -> None:
        """Release every channel that was used and free the hardware. Closing twice does nothing; raises nothing."""


def on_grid(pulse_us: float, resolution_us: float) -> float:
    """Return the multiple of `resolution_us` nearest to `pulse_us` [us]."""
    return round(pulse_us / resolution_us) * resolution_us
