"""A PCA9685 through Adafruit's own library, on an I2C bus with one chip's registers."""

import struct
import sys
import types
from typing import Any

import pytest

from vergence_servo.drivers.pca9685 import Pca9685Driver, Pca9685Parameters
from vergence_servo.drivers.protocol import ChannelError, DriverIoError, DriverUnavailableError


class I2cChip:
    """A bus as Blinka's, with one PCA9685 on it: 256 registers, auto-increment, one lock."""

    MODE1, PRESCALE, LED0 = 0x00, 0xFE, 0x06

    def __init__(self, address: int = 0x40) -> None:
        self.registers = bytearray(256)
        self.registers[self.PRESCALE] = 0x1E
        self.address, self.present, self._locked = address, True, False
        for channel in range(16):
            self.registers[self.LED0 + 4 * channel + 3] = 0x10

    def ticks(self, channel: int) -> int | None:
        on, off = struct.unpack_from("<HH", self.registers, self.LED0 + 4 * channel)
        return None if off & 0x1000 else off - on

    def try_lock(self) -> bool:
        taken, self._locked = not self._locked, True
        return taken

    def unlock(self) -> None:
        self._locked = False

    def scan(self) -> list[int]:
        return [self.address] if self.present else []

    def writeto(self, address: int, buffer: Any, *, start: int = 0, end: int | None = None) -> None:
        self._answer(address)
        data = bytes(buffer[start:end])
        if data:
            self.registers[data[0] : data[0] + len(data) - 1] = data[1:]

    def readfrom_into(self, address: int, buffer: Any, *, start: int = 0, end: int | None = None) -> None:
        self._answer(address)

    def writeto_then_readfrom(
        self,
        address: int,
        out: Any,
        into: Any,
        *,
        out_start: int = 0,
        out_end: int | None = None,
        in_start: int = 0,
        in_end: int | None = None,
    ) -> None:
        self._answer(address)
        count = (len(into) if in_end is None else in_end) - in_start
        first = out[out_start]
        into[in_start : in_start + count] = self.registers[first : first + count]

    def _answer(self, address: int) -> None:
        if not self.present or address != self.address:
            raise OSError(121, "Remote I/O error")


@pytest.fixture
def i2c() -> I2cChip:
    pytest.importorskip("adafruit_pca9685", reason="adafruit-circuitpython-pca9685 is not installed")
    return I2cChip()


def test_pca9685_sets_ticks_of_the_real_frequency(i2c: I2cChip):
    driver = Pca9685Driver(bus=i2c)
    assert driver.resolution_us == pytest.approx(4.88)
    assert i2c.registers[I2cChip.PRESCALE] == 121
    assert driver.set_pulse_us(3, 1500.0) == pytest.approx(307 * 4.88)
    assert i2c.ticks(3) == 307
    assert i2c.ticks(2) is None
    driver.release(3)
    assert i2c.ticks(3) is None
    driver.set_pulse_us(0, 1000.0)
    driver.close()
    assert i2c.ticks(0) is None


def test_pca9685_keeps_pulsing_what_a_dead_process_left_until_it_is_released(i2c: I2cChip):
    Pca9685Driver(bus=i2c).set_pulse_us(5, 1500.0)  # and then the process is killed
    assert i2c.ticks(5) == 307
    Pca9685Driver(bus=i2c).release(5)
    assert i2c.ticks(5) is None


def test_pca9685_reports_a_lost_bus_and_recovers(i2c: I2cChip):
    driver = Pca9685Driver(bus=i2c)
    i2c.present = False
    with pytest.raises(DriverIoError, match=r"channel 1.*Remote I/O"):
        driver.set_pulse_us(1, 1500.0)
    i2c.present = True
    driver.set_pulse_us(1, 1500.0)
    assert i2c.ticks(1) == 307
    i2c.present = False
    driver.close()


def test_pca9685_names_what_is_wrong(i2c: I2cChip, monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(DriverUnavailableError, match=r"0x41.*i2cdetect"):
        Pca9685Driver(Pca9685Parameters(address=0x41), bus=i2c)
    with pytest.raises(ChannelError, match="0 to 15"):
        Pca9685Driver(bus=i2c).set_pulse_us(16, 1500.0)
    monkeypatch.setitem(sys.modules, "adafruit_pca9685", None)
    with pytest.raises(DriverUnavailableError, match=r"pip install .*adafruit-circuitpython-pca9685"):
        Pca9685Driver(bus=i2c)


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (PermissionError(13, "Permission denied: '/dev/i2c-1'"), "usermod -aG i2c"),
        (ValueError("No Hardware I2C on (scl,sda)=(3, 2)"), "dtparam=i2c_arm=on"),
    ],
)
def test_pca9685_names_the_group_and_the_boot_line(
    i2c: I2cChip, monkeypatch: pytest.MonkeyPatch, error: Exception, text: str
):
    board: Any = types.ModuleType("board")

    def no_bus() -> None:
        raise error

    board.I2C = no_bus
    monkeypatch.setitem(sys.modules, "board", board)
    with pytest.raises(DriverUnavailableError, match=text):
        Pca9685Driver()
