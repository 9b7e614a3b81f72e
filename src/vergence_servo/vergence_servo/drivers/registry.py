"""Servo drivers by name. `register_backend` adds one; the parameter `backend` of servo_node chooses one."""

from collections.abc import Mapping
from typing import Any

from vergence_servo.drivers import fake, kernel_pwm, lgpio, pca9685, pigpio
from vergence_servo.drivers.protocol import Backend, DriverUnavailableError, ServoDriver

REFUSED = {
    "gpiozero": (
        "gpiozero over lgpio sets the duty cycle in whole percent: a servo gets 11 positions, about 19 degrees apart "
        "(gpiozero issue 1209). Use kernel_pwm, pca9685 or, failing these, lgpio"
    ),
}
"""Names that users may expect but that are refused, each with the reason."""

_BACKENDS: dict[str, Backend] = {}


def register_backend(backend: Backend) -> None:
    """Add a driver under a name that is free; raises ValueError for one in use."""
    if backend.name in _BACKENDS or backend.name in REFUSED:
        raise ValueError(f"the name of a servo driver must be new: got {backend.name!r}, which is registered")
    _BACKENDS[backend.name] = backend


def backend_names() -> tuple[str, ...]:
    """Return the names of all registered drivers, in order of registration."""
    return tuple(_BACKENDS)


def backends() -> tuple[Backend, ...]:
    """Return all registered drivers, in order of registration."""
    return tuple(_BACKENDS.values())


def find_backend(name: str) -> Backend:
    """Return the driver registered under a name. Raises DriverUnavailableError, with the reason for a refused name."""
    if name in REFUSED:
        raise DriverUnavailableError(f"parameter 'backend' must not be {name!r}: {REFUSED[name]}")
    if name not in _BACKENDS:
        raise DriverUnavailableError(f"parameter 'backend' must be one of {', '.join(_BACKENDS)}: got {name!r}")
    return _BACKENDS[name]


def open_driver(name: str, values: Mapping[str, Any] | None = None) -> ServoDriver:
    """Open a driver with its parameters by name. Raises DriverUnavailableError or ParameterError."""
    entry = find_backend(name)
    return entry.open(entry.parameters.from_mapping(values or {}))


for _module in (fake, kernel_pwm, pca9685, pigpio, lgpio):
    register_backend(_module.BACKEND)
