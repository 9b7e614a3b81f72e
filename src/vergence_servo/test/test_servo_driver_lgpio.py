"""lgpio with a fake of the module itself."""

import sys
import types

import pytest

from vergence_servo.drivers.lgpio import LgpioDriver
from vergence_servo.drivers.protocol import ChannelError, DriverIoError, DriverUnavailableError
from vergence_servo.drivers.registry import open_driver


class FakeLgpio(types.ModuleType):
    """As much of lgpio as servos need: a chip, lines that must be claimed, and pulses."""

    class error(Exception):  # noqa: N801, N818 - lgpio's own name
        pass

    def __init__(self) -> None:
        super().__init__("lgpio")
        self.lines: dict[int, int] = {}
        self.open_chips: set[int] = set()

    def gpiochip_open(self, chip: int) -> int:
        if chip != 0:
            raise self.error("can not open gpiochip")
        self.open_chips.add(1)
        return 1

    def gpiochip_close(self, handle: int) -> None:
        self.open_chips.remove(handle)
        self.lines.clear()

    def gpio_claim_output(self, handle: int, gpio: int, level: int = 0) -> int:
        if gpio in self.lines or gpio == 7:
            raise self.error("GPIO busy")
        self.lines[gpio] = level
        return 0

    def gpio_free(self, handle: int, gpio: int) -> int:
        del self.lines[gpio]
        return 0

    def tx_servo(self, handle: int, gpio: int, pulse_width: int, servo_frequency: int = 50) -> int:
        if handle not in self.open_chips or gpio not in self.lines:
            raise self.error("GPIO not allocated")
        if type(pulse_width) is not int or not (pulse_width == 0 or 500 <= pulse_width <= 2500):
            raise self.error("bad servo pulse width")
        self.lines[gpio] = pulse_width
        return 1


@pytest.fixture
def lgpio(monkeypatch: pytest.MonkeyPatch) -> FakeLgpio:
    module = FakeLgpio()
    monkeypatch.setitem(sys.modules, "lgpio", module)
    return module


def test_lgpio_claims_a_line_and_sends_whole_microseconds(lgpio: FakeLgpio):
    driver = LgpioDriver()
    assert driver.set_pulse_us(12, 1500.4) == 1500.0
    assert driver.set_pulse_us(12, 1501.6) == 1502.0
    assert lgpio.lines == {12: 1502}
    driver.release(12)
    driver.release(12)
    assert lgpio.lines == {}
    driver.set_pulse_us(13, 1500.0)
    driver.close()
    driver.close()
    assert lgpio.open_chips == set()


def test_lgpio_says_what_is_wrong(lgpio: FakeLgpio, monkeypatch: pytest.MonkeyPatch):
    driver = LgpioDriver()
    with pytest.raises(DriverIoError, match="GPIO 7: GPIO busy"):
        driver.set_pulse_us(7, 1500.0)
    with pytest.raises(DriverIoError, match="500 to 2500"):
        driver.set_pulse_us(12, 400.0)
    with pytest.raises(ChannelError, match="GPIO number"):
        driver.set_pulse_us(60, 1500.0)
    with pytest.raises(DriverUnavailableError, match=r"gpiochip4.*usermod -aG gpio"):
        open_driver("lgpio", {"chip": 4})
    monkeypatch.setitem(sys.modules, "lgpio", None)
    with pytest.raises(DriverUnavailableError, match="python3-lgpio"):
        LgpioDriver()
