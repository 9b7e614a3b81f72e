"""Every backend against a fake of what lies below it: a sysfs tree, an I2C bus, lgpio itself, a pigpio daemon."""

import os
import socket
import struct
import sys
import threading
import types
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from vergence_servo.drivers import kernel_pwm
from vergence_servo.drivers.fake import FakeDriver, FakeParameters
from vergence_servo.drivers.kernel_pwm import KernelPwmDriver, KernelPwmParameters
from vergence_servo.drivers.lgpio import LgpioDriver
from vergence_servo.drivers.pca9685 import Pca9685Driver, Pca9685Parameters
from vergence_servo.drivers.pigpio import PigpioDriver, PigpioParameters
from vergence_servo.drivers.protocol import ChannelError, DriverIoError, DriverUnavailableError
from vergence_servo.drivers.registry import check_name, open_driver

# ---- kernel PWM: a sysfs tree whose `export` is served by a thread, as by the kernel


class SysfsPwm:
    """One pwmchip in a temporary folder. `export` is a pipe: writing a number makes the channel's folder."""

    def __init__(self, root: Path, number: int = 0, channels: int = 4, block: str = "") -> None:
        self.chip = root / f"pwmchip{number}"
        self.chip.mkdir(parents=True)
        (self.chip / "npwm").write_text(f"{channels}\n")
        if block:
            (root / "devices" / block).mkdir(parents=True)
            (self.chip / "device").symlink_to(root / "devices" / block)
        os.mkfifo(self.chip / "export")
        self._pipe = os.open(self.chip / "export", os.O_RDWR)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def read(self, channel: int, name: str) -> int:
        return int((self.chip / f"pwm{channel}" / name).read_text().split()[0])

    def close(self) -> None:
        os.write(self._pipe, b"end\n")
        self._thread.join()
        os.close(self._pipe)

    def _serve(self) -> None:
        while (text := os.read(self._pipe, 64).decode().split()[0]) != "end":
            folder = self.chip / "new"
            folder.mkdir()
            for name in ("duty_cycle", "period", "enable"):
                (folder / name).write_text("0\n")
            folder.rename(self.chip / f"pwm{text}")


@pytest.fixture(autouse=True)
def udev_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Longer than a slow machine's thread takes to make a channel."""
    monkeypatch.setattr(kernel_pwm, "_UDEV_PATIENCE_S", 60.0)


@pytest.fixture
def sysfs(tmp_path: Path) -> Iterator[SysfsPwm]:
    tree = SysfsPwm(tmp_path)
    yield tree
    tree.close()


def test_kernel_pwm_exports_a_channel_and_sets_nanoseconds(sysfs: SysfsPwm, tmp_path: Path):
    driver = KernelPwmDriver(KernelPwmParameters(root=str(tmp_path)))
    assert driver.set_pulse_us(2, 1500.003) == 1500.0
    assert [sysfs.read(2, name) for name in ("period", "duty_cycle", "enable")] == [20_000_000, 1_500_000, 1]
    driver.set_pulse_us(2, 999.98)
    assert sysfs.read(2, "duty_cycle") == 999_980
    driver.release(2)
    assert [sysfs.read(2, name) for name in ("duty_cycle", "enable")] == [0, 0]
    driver.set_pulse_us(2, 1200.0)
    driver.close()
    driver.close()
    assert sysfs.read(2, "enable") == 0


def test_kernel_pwm_refuses_channels_and_pulses_that_cannot_be(sysfs: SysfsPwm, tmp_path: Path):
    driver = KernelPwmDriver(KernelPwmParameters(root=str(tmp_path)))
    with pytest.raises(ChannelError, match="0 to 3"):
        driver.set_pulse_us(4, 1500.0)
    with pytest.raises(DriverIoError, match="does not fit"):
        driver.set_pulse_us(0, 30_000.0)
    driver.release(1)  # never exported: nothing to release


def test_kernel_pwm_reports_a_chip_that_vanishes_and_takes_it_back(sysfs: SysfsPwm, tmp_path: Path):
    driver = KernelPwmDriver(KernelPwmParameters(root=str(tmp_path)))
    driver.set_pulse_us(0, 1500.0)
    (sysfs.chip / "pwm0").rename(tmp_path / "away")
    with pytest.raises(DriverIoError, match="No such file"):
        driver.set_pulse_us(0, 1400.0)
    (tmp_path / "away" / "enable").write_text("0\n")
    (tmp_path / "away").rename(sysfs.chip / "pwm0")
    driver.set_pulse_us(0, 1400.0)
    assert [sysfs.read(0, name) for name in ("duty_cycle", "enable")] == [1_400_000, 1]


def test_kernel_pwm_waits_for_udev_at_the_first_use_alone(
    sysfs: SysfsPwm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    driver = KernelPwmDriver(KernelPwmParameters(root=str(tmp_path)))
    driver.set_pulse_us(0, 1500.0)
    driver.release(0)

    def gone(path: Path, value: int) -> None:
        raise FileNotFoundError(2, "No such file or directory", str(path))

    waits: list[float] = []
    monkeypatch.setattr(kernel_pwm, "_write", gone)
    monkeypatch.setattr("vergence_servo.drivers.kernel_pwm.time.sleep", waits.append)
    with pytest.raises(DriverIoError, match="No such file"):
        driver.set_pulse_us(0, 1400.0)
    assert waits == []


def test_kernel_pwm_finds_the_chip_of_the_header(tmp_path: Path):
    fan = SysfsPwm(tmp_path, 0, 4, "1f0009c000.pwm")
    header = SysfsPwm(tmp_path, 2, 4, "1f00098000.pwm")
    KernelPwmDriver(KernelPwmParameters(root=str(tmp_path))).set_pulse_us(0, 1500.0)
    assert header.read(0, "enable") == 1
    KernelPwmDriver(KernelPwmParameters(root=str(tmp_path), chip=0)).set_pulse_us(1, 1500.0)
    assert fan.read(1, "enable") == 1
    with pytest.raises(DriverUnavailableError, match="allowed is one of 0, 2"):
        KernelPwmDriver(KernelPwmParameters(root=str(tmp_path), chip=1))
    header.close()
    fan.close()


def test_kernel_pwm_names_the_device_tree_line_and_the_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(kernel_pwm, "_UDEV_PATIENCE_S", 0.05)
    with pytest.raises(DriverUnavailableError, match=r"dtoverlay=pwm-2chan,pin=12,func=4,pin2=13,func2=4"):
        KernelPwmDriver(KernelPwmParameters(root=str(tmp_path)))
    chip = tmp_path / "pwmchip0"
    (chip / "pwm0").mkdir(parents=True)
    (chip / "npwm").write_text("2\n")
    (chip / "pwm0" / "duty_cycle").mkdir()  # nobody, not even root, can write to it
    with pytest.raises(DriverIoError):
        KernelPwmDriver(KernelPwmParameters(root=str(tmp_path))).set_pulse_us(0, 1500.0)


def test_kernel_pwm_permission_names_the_group(sysfs: SysfsPwm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: Any, **__: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(kernel_pwm, "_UDEV_PATIENCE_S", 0.05)
    driver = KernelPwmDriver(KernelPwmParameters(root=str(tmp_path)))
    monkeypatch.setattr("builtins.open", refuse)
    with pytest.raises(DriverIoError, match="usermod -aG gpio"):
        driver.set_pulse_us(0, 1500.0)


# ---- PCA9685: a chip with registers behind Adafruit's library


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
    with pytest.raises(DriverUnavailableError, match="pip install adafruit-circuitpython-pca9685"):
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


# ---- pigpio: a small daemon that speaks its socket protocol


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


# ---- lgpio: the module itself


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


# ---- the shipped fake, and the registry


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
