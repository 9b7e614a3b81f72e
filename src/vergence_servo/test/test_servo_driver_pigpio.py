"""pigpio against a small daemon that speaks its socket protocol."""

import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest

from vergence_servo.drivers.pigpio import PigpioDriver, PigpioParameters
from vergence_servo.drivers.protocol import ChannelError, DriverIoError, DriverUnavailableError


class PigpioDaemon:
    """Answers SERVO, PFG, PRRG and PIGPV on a port of this host, as pigpiod does."""

    def __init__(self, sample_us: int = 5) -> None:
        self.sample_us = sample_us
        self.pulses: dict[int, int] = {}
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = self._server.getsockname()[1]
        self._clients: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept, daemon=True)]
        self._threads[0].start()

    def drop_clients(self) -> None:
        for client in self._clients:
            with suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
        self._clients.clear()

    def close(self) -> None:
        with suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self.drop_clients()
        for thread in self._threads:
            thread.join()

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._server.accept()
            except OSError:
                return
            self._clients.append(client)
            thread = threading.Thread(target=self._serve, args=(client,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _serve(self, client: socket.socket) -> None:
        with client, suppress(OSError):
            while len(request := client.recv(16, socket.MSG_WAITALL)) == 16:
                command, first, second, _ = struct.unpack("<IIII", request)
                client.sendall(struct.pack("<IIIi", command, first, second, self._answer(command, first, second)))

    def _answer(self, command: int, first: int, second: int) -> int:
        if command == 8:
            if second != 0 and not 500 <= second <= 2500:
                return -7
            if first == 28:
                return -41
            self.pulses[first] = second
            return 0
        return {23: 800, 24: 1_000_000 // 800 // self.sample_us, 26: 79}.get(command, -88)


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


def test_pigpio_names_the_service_where_there_is_no_daemon():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(DriverUnavailableError, match="systemctl enable --now pigpiod"):
        PigpioDriver(PigpioParameters(host="127.0.0.1", port=port))
