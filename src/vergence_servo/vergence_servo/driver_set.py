"""The drivers of a head: one of each backend that its servos name, opened and closed together."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from types import MappingProxyType
from typing import Any

from vergence_servo.calibration import ServoCalibration, ServoCalibrationError, check_channels
from vergence_servo.drivers.protocol import Backend, DriverUnavailableError, ServoDriver
from vergence_servo.drivers.registry import find_backend, open_driver
from vergence_servo.hardware_lock import HardwareLocks


def backends_of(servos: Mapping[str, ServoCalibration], joints: Iterable[str], default: str) -> dict[str, str]:
    """Return the backend of each joint: the one that servos.yaml names for it, else `default`.

    Raises:
        ServoCalibrationError: a joint without a servo, an unknown backend, or one channel for two joints.
        DriverUnavailableError: `default` is used and unknown or refused.
    """
    chosen: dict[str, str] = {}
    for name in joints:
        if name not in servos:
            raise ServoCalibrationError(f"joint '{name}' has no servo: servos.yaml has {', '.join(servos)}")
        own = servos[name].backend
        try:
            chosen[name] = find_backend(own or default).name
        except DriverUnavailableError as error:
            if not own:
                raise
            text = str(error).replace("parameter 'backend'", f"servos.{name}.backend")
            raise ServoCalibrationError(text) from error
    check_channels(chosen, servos)
    return chosen


class DriverSet:
    """One open driver of each backend; `backends` is the backend of each joint."""

    def __init__(
        self,
        backends: Mapping[str, str],
        values: Callable[[Backend], Mapping[str, Any]],
        channels: Mapping[str, int] = MappingProxyType({}),
    ) -> None:
        """Open every backend once, with the parameters that `values` returns for it.

        With the joints' `channels`, their hardware is locked first, so that no other process drives it. Raises
        DriverUnavailableError or ParameterError where one cannot be opened; the others are closed then.
        """
        self.backends = dict(backends)
        self.values = {name: dict(values(find_backend(name))) for name in dict.fromkeys(backends.values())}
        self._drivers: dict[str, ServoDriver] = {}
        with ExitStack() as opened:
            self.locks = HardwareLocks(self._hardware(channels))
            opened.callback(self.locks.close)
            for name, given in self.values.items():
                self._drivers[name] = open_driver(name, given)
                opened.callback(self._drivers[name].close)
            opened.pop_all()

    def _hardware(self, channels: Mapping[str, int]) -> list[str]:
        needed: list[str] = []
        for name, given in self.values.items():
            entry = find_backend(name)
            used = [channels[joint] for joint in self.joints(name) if joint in channels]
            if entry.hardware is not None and used:
                needed += entry.hardware(entry.parameters.from_mapping(given), used)
        return needed

    @property
    def by_backend(self) -> Mapping[str, ServoDriver]:
        """The open drivers, by the name of their backend."""
        return self._drivers

    @property
    def by_joint(self) -> dict[str, ServoDriver]:
        """The driver of each joint."""
        return {joint: self._drivers[backend] for joint, backend in self.backends.items()}

    def joints(self, backend: str) -> list[str]:
        """Return the joints of a backend."""
        return [joint for joint, name in self.backends.items() if name == backend]

    def description(self) -> str:
        """Return the backend, or which joints are on which, as in "kernel_pwm: pan_left, pan_right; pca9685: tilt"."""
        if len(self._drivers) == 1:
            return next(iter(self._drivers))
        return "; ".join(f"{name}: {', '.join(self.joints(name))}" for name in self._drivers)

    def close(self) -> None:
        """Release every channel that was used and free the hardware, backend by backend."""
        for driver in self._drivers.values():
            driver.close()
        self.locks.close()
