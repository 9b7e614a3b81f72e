"""The shipped fake's servos, and backends by name."""

from collections.abc import Callable

import pytest

from vergence_rig.parameters import ParameterError
from vergence_servo.drivers import registry
from vergence_servo.drivers.fake import FakeDriver, FakeParameters
from vergence_servo.drivers.protocol import Backend, ChannelError, DriverUnavailableError
from vergence_servo.drivers.registry import backend_names, find_backend, open_driver, register_backend
from vergence_servo.parameters import ServoNodeParameters, parameter_groups


def test_fake_servos_take_their_time():
    now = [0.0]
    driver = FakeDriver(FakeParameters(speed_us_s=1000.0), clock=lambda: now[0])
    driver.set_pulse_us(0, 1700.0)
    now[0] = 0.1
    assert driver.position_us(0) == pytest.approx(1600.0)
    driver.release(0)
    now[0] = 9.0
    assert driver.position_us(0) == pytest.approx(1600.0)
    driver.set_pulse_us(0, 1700.0)
    now[0] = 9.2
    assert driver.position_us(0) == pytest.approx(1700.0)


@pytest.mark.parametrize(
    "make", [lambda: FakeDriver(), lambda: FakeDriver(FakeParameters(resolution_us=4.88, channels=3))]
)
def test_fake_keeps_the_protocol(make: Callable[[], FakeDriver]):
    driver = make()
    sent_us = driver.set_pulse_us(2, 1503.3)
    assert abs(sent_us - 1503.3) <= driver.resolution_us / 2
    with pytest.raises(ChannelError):
        driver.set_pulse_us(99, 1500.0)
    driver.close()
    assert driver.pulse_us(2) is None


def test_gpiozero_is_refused_with_the_reason():
    with pytest.raises(DriverUnavailableError, match="11 positions"):
        find_backend("gpiozero")
    with pytest.raises(DriverUnavailableError, match="must be one of fake, kernel_pwm, pca9685, pigpio, lgpio"):
        open_driver("arduino")


def test_a_registered_driver_is_a_choice_and_has_its_parameters(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(registry, "_BACKENDS", dict(registry._BACKENDS))
    with pytest.raises(ParameterError, match="backend"):
        ServoNodeParameters(backend="mine", servos="servos.yaml")
    register_backend(Backend("mine", FakeParameters, FakeDriver))
    assert ServoNodeParameters(backend="mine", servos="servos.yaml").backend == "mine"
    assert ("mine.", FakeParameters) in parameter_groups()
    assert isinstance(open_driver("mine", {"channels": 3}), FakeDriver)
    with pytest.raises(ParameterError, match="servos"):
        ServoNodeParameters(backend="mine")


@pytest.mark.parametrize("name", ["fake", "gpiozero"])
def test_a_name_in_use_is_not_registered_again(name: str):
    before = backend_names()
    with pytest.raises(ValueError, match="must be new"):
        register_backend(Backend(name, FakeParameters, FakeDriver))
    assert backend_names() == before
