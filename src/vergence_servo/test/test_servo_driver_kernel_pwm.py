"""Kernel PWM over a sysfs tree in a folder, whose `export` is served by a thread, as by the kernel."""

import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from vergence_servo.drivers import kernel_pwm
from vergence_servo.drivers.kernel_pwm import KernelPwmDriver, KernelPwmParameters
from vergence_servo.drivers.protocol import ChannelError, DriverIoError, DriverUnavailableError


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
    monkeypatch.setattr(kernel_pwm, "_UDEV_TIMEOUT_S", 60.0)


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
    with pytest.raises(DriverIoError, match="must be above 0 and below"):
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
    with pytest.raises(DriverUnavailableError, match="must be one of 0, 2"):
        KernelPwmDriver(KernelPwmParameters(root=str(tmp_path), chip=1))
    header.close()
    fan.close()


def test_kernel_pwm_names_the_device_tree_line_and_the_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(kernel_pwm, "_UDEV_TIMEOUT_S", 0.05)
    with pytest.raises(DriverUnavailableError, match=r"dtoverlay=pwm-2chan,pin=12,func=4,pin2=13,func2=4"):
        KernelPwmDriver(KernelPwmParameters(root=str(tmp_path)))
    chip = tmp_path / "pwmchip0"
    (chip / "pwm0").mkdir(parents=True)
    (chip / "npwm").write_text("2\n")
    (chip / "pwm0" / "duty_cycle").mkdir()  # not even root can write to it
    with pytest.raises(DriverIoError):
        KernelPwmDriver(KernelPwmParameters(root=str(tmp_path))).set_pulse_us(0, 1500.0)


def test_kernel_pwm_permission_names_the_group(sysfs: SysfsPwm, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: Any, **__: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(kernel_pwm, "_UDEV_TIMEOUT_S", 0.05)
    driver = KernelPwmDriver(KernelPwmParameters(root=str(tmp_path)))
    monkeypatch.setattr("builtins.open", refuse)
    with pytest.raises(DriverIoError, match="usermod -aG gpio"):
        driver.set_pulse_us(0, 1500.0)
