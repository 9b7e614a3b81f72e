"""Backends by name."""

from collections.abc import Mapping
from typing import Any

from vergence_rig.parameters import Parameters
from vergence_servo.drivers.fake import FakeDriver, FakeParameters
from vergence_servo.drivers.kernel_pwm import KernelPwmDriver, KernelPwmParameters
from vergence_servo.drivers.lgpio import LgpioDriver, LgpioParameters
from vergence_servo.drivers.pca9685 import Pca9685Driver, Pca9685Parameters
from vergence_servo.drivers.pigpio import PigpioDriver, PigpioParameters
from vergence_servo.drivers.protocol import DriverUnavailableError, ServoDriver

BACKENDS: dict[str, tuple[type[Parameters], Any]] = {
    "fake": (FakeParameters, FakeDriver),
    "kernel_pwm": (KernelPwmParameters, KernelPwmDriver),
    "pca9685": (Pca9685Parameters, Pca9685Driver),
    "pigpio": (PigpioParameters, PigpioDriver),
    "lgpio": (LgpioParameters, LgpioDriver),
}
"""Name to the parameters' and the driver's class."""

REFUSED = {
    "gpiozero": (
        "gpiozero over lgpio sets the duty cycle in whole percent: a servo gets 11 positions, about 19 degrees apart "
        "(gpiozero issue 1209). Use kernel_pwm, pca9685 or, failing these, lgpio"
    ),
}
"""Backends that one may ask for and does not get, with the reason."""


def check_name(name: str) -> None:
    """Raise DriverUnavailableError if there is no such backend, with the reason where it is refused."""
    if name in REFUSED:
        raise DriverUnavailableError(f"parameter 'backend' is {name!r}: refused, because {REFUSED[name]}")
    if name not in BACKENDS:
        raise DriverUnavailableError(f"parameter 'backend' is {name!r}: allowed is one of {', '.join(BACKENDS)}")


def open_driver(name: str, values: Mapping[str, Any] | None = None) -> ServoDriver:
    """Open a backend with its parameters by name. Raises DriverUnavailableError or ParameterError."""
    check_name(name)
    parameters, driver = BACKENDS[name]
    opened: ServoDriver = driver(parameters.from_mapping(values or {}))
    return opened
