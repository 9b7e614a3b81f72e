"""Hardware PWM through the kernel's /sys/class/pwm: 2 channels on a Raspberry Pi up to 4, 4 on a Pi 5.

The pulses are made by hardware and do not jitter. They go on when the process dies: `servo_node` has a guardian process
for that.
"""

import errno
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vergence_rig.parameters import Parameters, parameter
from vergence_rig.regular_file import expanded
from vergence_servo.drivers.protocol import Backend, ChannelError, DriverIoError, DriverUnavailableError

_OVERLAY = "dtoverlay=pwm-2chan,pin=12,func=4,pin2=13,func2=4"
_BOOT_LINE = f"add '{_OVERLAY}' to /boot/firmware/config.txt and reboot"
_GROUP = "sudo usermod -aG gpio $USER, then log in anew"
# The PWM blocks behind the header's pins: BCM2835 to 2837, BCM2711 (Pi 4), RP1 (Pi 5).
_HEADER_BLOCKS = ("20203000.pwm", "3f20c000.pwm", "7e20c000.pwm", "fe20c000.pwm", "1f00098000.pwm")
_UDEV_TIMEOUT_S = 2.0


@dataclass(frozen=True)
class KernelPwmParameters(Parameters):
    """Which PWM chip, and its period."""

    root: str = parameter("/sys/class/pwm", "folder in which the kernel shows its PWM chips", read_only=True)
    chip: int = parameter(
        -1,
        "number N of /sys/class/pwm/pwmchipN; -1 finds the chip behind the header's pins",
        minimum=-1,
        maximum=99,
        read_only=True,
    )
    frequency_hz: float = parameter(
        50.0, "pulses per second of the PWM chip", unit="Hz", minimum=20, maximum=400, read_only=True
    )


class KernelPwmDriver:
    """Pulses from the chip's channels, set in nanoseconds."""

    outlives_process = True
    # sysfs counts nanoseconds; the hardware counts its 100 MHz (Pi 4) or 50 MHz (Pi 5) clock.
    resolution_us = 0.02

    def __init__(self, parameters: KernelPwmParameters | None = None) -> None:
        values = parameters or KernelPwmParameters()
        self._chip = _find_chip(expanded(values.root), values.chip)
        self._count = _read_count(self._chip)
        self._period_ns = round(1e9 / values.frequency_hz)
        self._enabled: set[int] = set()
        self._used: set[int] = set()

    def set_pulse_us(self, channel: int, pulse_us: float) -> float:
        """See ServoDriver; the channel is exported and its period set when it is first used."""
        folder = self._folder(channel)
        pulse_ns = round(pulse_us / self.resolution_us) * round(self.resolution_us * 1000)
        if not 0 < pulse_ns < self._period_ns:
            period_us = self._period_ns / 1000
            raise DriverIoError(
                errno.EINVAL, f"pulse must be above 0 and below {period_us:g} us: got {pulse_us}", str(folder)
            )
        try:
            if channel not in self._enabled:
                self._prepare(channel, folder)
            _write(folder / "duty_cycle", pulse_ns)
            if channel not in self._enabled:
                _write(folder / "enable", 1)
        except OSError as error:
            self._enabled.discard(channel)
            raise _explained(error) from error
        self._enabled.add(channel)
        return pulse_ns / 1000

    def release(self, channel: int) -> None:
        """See ServoDriver; also stops what a process that was killed has left pulsing."""
        folder = self._folder(channel)
        self._enabled.discard(channel)
        if not folder.is_dir():
            return
        try:
            if (folder / "enable").read_text().strip() != "0":
                _write(folder / "duty_cycle", 0)
                _write(folder / "enable", 0)
        except OSError as error:
            raise _explained(error) from error

    def close(self) -> None:
        """See ServoDriver. Channels stay exported: unexporting would give the pin no defined state."""
        for channel in tuple(self._enabled):
            try:
                self.release(channel)
            except DriverIoError:
                continue  # nothing more can be done for a chip that is gone

    def _folder(self, channel: int) -> Path:
        if not 0 <= channel < self._count:
            raise ChannelError(
                f"backend 'kernel_pwm': channel must be 0 to {self._count - 1}: got {channel} ({self._chip}; GPIO 12, "
                "13, 18, 19 are channels 0, 1, 2, 3 on a Pi 5 and 0, 1, 0, 1 on earlier ones; a servo may name another "
                "backend in servos.yaml)"
            )
        return self._chip / f"pwm{channel}"

    def _prepare(self, channel: int, folder: Path) -> None:
        if not folder.is_dir():
            _write(self._chip / "export", channel)
        # Waiting holds up all servos: a channel that fails later is tried again by its ServoChannel instead.
        deadline_s = time.monotonic() + (0.0 if channel in self._used else _UDEV_TIMEOUT_S)
        self._used.add(channel)
        while True:
            try:
                self._set_period(folder)
                return
            except (PermissionError, FileNotFoundError):
                # udev hands a new channel to the group gpio a moment after it appears
                if time.monotonic() >= deadline_s:
                    raise
                time.sleep(0.01)

    def _set_period(self, folder: Path) -> None:
        try:
            _write(folder / "period", self._period_ns)
        except OSError as error:
            if error.errno != errno.EINVAL:
                raise
            _write(folder / "duty_cycle", 0)  # another period's pulse was longer than this period
            _write(folder / "period", self._period_ns)


def _find_chip(root: Path, number: int) -> Path:
    chips = sorted(root.glob("pwmchip*"), key=lambda path: int(path.name.removeprefix("pwmchip")))
    if not chips:
        raise DriverUnavailableError(f"backend 'kernel_pwm': no PWM chip in {root}: {_BOOT_LINE}")
    if number >= 0:
        chip = root / f"pwmchip{number}"
        if chip not in chips:
            there = ", ".join(path.name.removeprefix("pwmchip") for path in chips)
            raise DriverUnavailableError(
                f"parameter 'kernel_pwm.chip' must be one of {there} (in {root}): got {number}"
            )
        return chip
    of_header = [chip for chip in chips if (chip / "device").resolve().name in _HEADER_BLOCKS]
    if len(of_header or chips) == 1:
        return (of_header or chips)[0]
    names = ", ".join(chip.name for chip in of_header or chips)
    raise DriverUnavailableError(
        f"backend 'kernel_pwm': {root} has {names}: choose one with the parameter kernel_pwm.chip"
    )


def _read_count(chip: Path) -> int:
    try:
        return int((chip / "npwm").read_text())
    except (OSError, ValueError) as error:
        raise DriverUnavailableError(f"backend 'kernel_pwm': {chip}/npwm cannot be read: {error}") from error


def _write(path: Path, value: int) -> None:
    # Opened each time: a channel may be unexported and exported again by others. sysfs ignores truncation.
    with open(path, "wb", buffering=0) as attribute:
        attribute.write(b"%d\n" % value)


def _explained(error: OSError) -> DriverIoError:
    text = error.strerror or str(error)
    if isinstance(error, PermissionError):
        text += f" ({_GROUP})"
    elif error.errno == errno.EBUSY:
        text += " (another program or overlay holds this PWM channel; analogue audio does on a Pi 4)"
    return DriverIoError(error.errno or errno.EIO, text, error.filename)


def _hardware(parameters: KernelPwmParameters, channels: Sequence[int]) -> list[str]:
    chip = _find_chip(Path(parameters.root), parameters.chip).resolve()
    return [f"channel {channel} of {chip}" for channel in channels]


BACKEND = Backend("kernel_pwm", KernelPwmParameters, KernelPwmDriver, hardware=_hardware)
