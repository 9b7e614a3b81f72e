"""The interface of a servo driver, its entry in the registry, and its errors."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from vergence_rig.parameters import Parameters


class DriverUnavailableError(ValueError):
    """A backend that cannot be opened here. The message names the package, group or boot line that is missing."""


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
            DriverIoError: the write failed.
        """

    def release(self, channel: int) -> None:
        """Stop the pulses, so that the servo goes limp. Releasing a released channel does nothing. Raises as above."""

    def close(self) -> None:
        """Release every channel that was used and free the hardware. Closing twice does nothing; raises nothing."""


@dataclass(frozen=True)
class Backend:
    """A servo driver under the name that the parameter `backend` chooses it by.

    Attributes:
        name: also the prefix of its parameters, such as `pca9685.address`.
        parameters: the class of its parameters.
        open: makes the driver from an instance of them; may raise DriverUnavailableError.
        moves_servos: False for one without hardware, which the built-in servos.yaml is good enough for.
        warning: logged at the start; empty for none.
        hardware: names the pieces of hardware that these channels need with these parameters, each of which one process
            may own; None for a backend without hardware of its own. It may raise DriverUnavailableError.
    """

    name: str
    parameters: type[Parameters]
    open: Callable[[Any], ServoDriver]
    moves_servos: bool = True
    warning: str = ""
    hardware: Callable[[Any, Sequence[int]], list[str]] | None = None


def on_grid(pulse_us: float, resolution_us: float) -> float:
    """Return the multiple of `resolution_us` nearest to `pulse_us` [us]."""
    return round(pulse_us / resolution_us) * resolution_us
