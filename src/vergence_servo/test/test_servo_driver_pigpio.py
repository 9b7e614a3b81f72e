"""pigpio against a small daemon that speaks its socket protocol."""

import socket
from collections.abc import Iterator

import pytest

from vergence_servo.drivers.pigpio import PigpioDriver, PigpioParameters
from vergence_servo.drivers.protocol import ChannelError, DriverIoError, DriverUnavailableError
from vergence_servo.testing.pigpio_daemon import PigpioDaemon


@pytest.fixture
def daemon() -> Iterator[PigpioDaemon]:
    server = PigpioDaemon()
    yield server
    server.close()


def pigpio(daemon: PigpioDaemon) -> PigpioDriver:
    return PigpioDriver(PigpioParameters(host="127.0.0.1", port=daemon.port, timeout_s=10.0))


def test_pigpio_learns_the_daemons_sample_time(daemon: PigpioDaemon):
    assert pigpio(daemon).resolution_us == 5.0
    daemon.sample_us = 1
    assert pigpio(daemon).resolution_us == 1.0


def test_pigpio_sets_and_releases(daemon: PigpioDaemon):
    driver = pigpio(daemon)
    assert driver.set_pulse_us(18, 1502.0) == 1500.0
    assert daemon.pulses == {18: 1500}
    driver.release(18)
    assert daemon.pulses == {18: 0}
    driver.set_pulse_us(12, 1000.0)
    driver.close()
    driver.close()
    assert daemon.pulses == {18: 0, 12: 0}


def test_pigpio_daemons_refusals_are_in_words(daemon: PigpioDaemon):
    driver = pigpio(daemon)
    with pytest.raises(DriverIoError, match="500 to 2500"):
        driver.set_pulse_us(18, 400.0)
    with pytest.raises(DriverIoError, match="not permitted"):
        driver.set_pulse_us(28, 1500.0)
    with pytest.raises(ChannelError, match="0 to 31"):
        driver.set_pulse_us(40, 1500.0)


def test_pigpio_connects_anew_after_a_lost_connection(daemon: PigpioDaemon):
    driver = pigpio(daemon)
    driver.set_pulse_us(18, 1500.0)
    daemon.drop_clients()
    with pytest.raises(DriverIoError, match="pigpio daemon"):
        driver.set_pulse_us(18, 1600.0)
    driver.set_pulse_us(18, 1600.0)
    assert daemon.pulses == {18: 1600}
    driver.close()


def test_pigpio_names_the_page_where_there_is_no_daemon():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(DriverUnavailableError, match=r"docs/servos\.md, 'pigpio'"):
        PigpioDriver(PigpioParameters(host="127.0.0.1", port=port))
