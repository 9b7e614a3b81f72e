"""The shipped fake's servos, and backends by name."""

from collections.abc import Callable

import pytest

from vergence_servo.drivers.fake import FakeDriver, FakeParameters
from vergence_servo.drivers.protocol import ChannelError, DriverUnavailableError
from vergence_servo.drivers.registry import check_name, open_driver


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
        check_name("gpiozero")
    with pytest.raises(DriverUnavailableError, match="allowed is one of fake, kernel_pwm, pca9685, pigpio, lgpio"):
        open_driver("arduino")
