"""One owner for each piece of hardware: another process is refused with the owner's pid, until the owner has ended."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from vergence_servo import hardware_lock
from vergence_servo.driver_set import DriverSet
from vergence_servo.drivers.protocol import DriverUnavailableError
from vergence_servo.hardware_lock import HardwareLocks, lock_folder

HOLDER = """
import sys
from pathlib import Path
from vergence_servo import hardware_lock
hardware_lock.lock_folder = lambda: Path(sys.argv[1])
locks = hardware_lock.HardwareLocks(sys.argv[2:])
print("held", flush=True)
sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(hardware_lock, "lock_folder", lambda: tmp_path)
    return tmp_path


@pytest.fixture
def owner(folder: Path) -> Iterator["subprocess.Popen[str]"]:
    command = [sys.executable, "-c", HOLDER, str(folder), "chip", "channel 1 of /sys/pwm"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_the_second_is_refused_with_the_owners_pid_and_holds_nothing(owner: "subprocess.Popen[str]") -> None:
    with pytest.raises(DriverUnavailableError, match=rf"channel 1 of /sys/pwm must have one owner: .* {owner.pid} "):
        HardwareLocks(["another", "channel 1 of /sys/pwm"])
    HardwareLocks(["another", "channel 2 of /sys/pwm"]).close()


def test_a_lock_ends_with_its_process_however_that_ends(owner: "subprocess.Popen[str]", folder: Path) -> None:
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    locks = HardwareLocks(["chip", "channel 1 of /sys/pwm"])
    assert {path.read_text() for path in folder.iterdir()} == {f"{os.getpid()}\n"}
    locks.close()
    assert not list(folder.iterdir())


def test_who_inherits_a_lock_holds_it(folder: Path) -> None:
    locks = HardwareLocks(["chip"])
    command = [sys.executable, "-c", "import sys; sys.stdin.read()"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, pass_fds=locks.descriptors) as guardian:
        for descriptor in locks.descriptors:
            os.close(descriptor)  # as the kernel does when this process is killed
        with pytest.raises(DriverUnavailableError, match="must have one owner"):
            HardwareLocks(["chip"])
        guardian.communicate()
    HardwareLocks(["chip"]).close()


def test_a_folder_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(hardware_lock, "lock_folder", lambda: tmp_path / "absent")
    with pytest.raises(DriverUnavailableError, match=r"chip: lock file .*absent/vergence_chip\.lock cannot be opened"):
        HardwareLocks(["chip"])


def test_the_folder_needs_no_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HOME", raising=False)
    assert lock_folder().is_dir()


@pytest.mark.parametrize("channels", [(0, 1), (1, 2)])
def test_two_sets_of_drivers_on_one_chip(tmp_path: Path, channels: tuple[int, int]) -> None:
    chip = tmp_path / "pwm" / "pwmchip0"
    chip.mkdir(parents=True)
    (chip / "npwm").write_text("4\n")

    def opened(*used: int) -> DriverSet:
        joints = {f"joint{number}": number for number in used}
        values = {"root": str(chip.parent)}
        return DriverSet(dict.fromkeys(joints, "kernel_pwm"), lambda backend: values, joints)

    first = opened(0, 1)
    with pytest.raises(DriverUnavailableError, match=rf"channel {min(1, channels[0])} of {chip} .* {os.getpid()} "):
        opened(*channels)
    opened(2, 3).close()
    first.close()
    opened(*channels).close()
