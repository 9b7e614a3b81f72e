"""Wiring, mounting and pulses of each servo (servos.yaml), and the conversion of pulses to angles and back.

The joint angle [rad] is the one on the topics. The pulse sets the shaft angle: shaft = sign * joint + trim.
Pulses are measured at two or more shaft angles, interpolated between them, and extrapolated beyond them.
"""

import bisect
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vergence_rig.parameters import REQUIRED, ParameterError, Parameters, parameter, shown
from vergence_rig.rig import JointSpec
from vergence_rig.servo import MG995, SG90, ServoSpec
from vergence_rig.yaml_file import YamlFileError, read_yaml

_DEG = math.pi / 180.0
_PLAUSIBLE_US_PER_RAD = (150.0, 4000.0)


class ServoCalibrationError(ValueError):
    """An invalid servos.yaml: the message names file, servo, key, what it must be, and the value."""


@dataclass(frozen=True)
class ServoCalibration(Parameters):
    """One servo: its channel, its pulses at known angles, and its limits."""

    channel: int = parameter(
        REQUIRED, "channel of the backend, or GPIO number, that the servo is wired to", minimum=0, maximum=63
    )
    backend: str = parameter("", "servo driver of this servo; empty for the parameter backend of servo_node")
    model: str = parameter("custom", "model of the servo: sg90 and mg995 are presets of speed, dead band and backlash")
    angles_rad: tuple[float, ...] = parameter(
        (-60.0 * _DEG, 60.0 * _DEG), "measured shaft angles, increasing", unit="rad", minimum=-math.pi, maximum=math.pi
    )
    pulses_us: tuple[float, ...] = parameter(
        (2500.0 / 3.0, 6500.0 / 3.0), "pulse at each of angles_rad, increasing", unit="us", minimum=300, maximum=2700
    )
    sign: int = parameter(1, "1, or -1 where longer pulses turn the joint towards smaller angles")
    trim_rad: float = parameter(0.0, "shaft angle at joint angle 0", unit="rad", minimum=-math.pi, maximum=math.pi)
    minimum_us: float = parameter(600.0, "shortest pulse that is sent", unit="us", minimum=300, maximum=2700)
    maximum_us: float = parameter(2400.0, "longest pulse that is sent", unit="us", minimum=300, maximum=2700)
    lower_rad: float = parameter(
        -60.0 * _DEG, "lower limit of the joint", unit="rad", minimum=-math.pi, maximum=math.pi
    )
    upper_rad: float = parameter(60.0 * _DEG, "upper limit of the joint", unit="rad", minimum=-math.pi, maximum=math.pi)
    speed_rad_s: float = parameter(600.0 * _DEG, "largest speed of the servo", unit="rad/s", minimum=0.01, maximum=100)
    dead_band_rad: float = parameter(
        0.75 * _DEG, "full width of the servo's dead band", unit="rad", minimum=0, maximum=0.2
    )
    backlash_rad: float = parameter(0.3 * _DEG, "full width of the gears' backlash", unit="rad", minimum=0, maximum=0.2)

    def check(self) -> None:
        """See Parameters."""
        if len(self.angles_rad) < 2 or any(b - a < 0.01 for a, b in zip(self.angles_rad, self.angles_rad[1:])):  # noqa: B905
            raise ParameterError(
                "angles_rad", self.angles_rad, "a list of two or more, each 0.01 or more above the last [rad]"
            )
        if len(self.pulses_us) != len(self.angles_rad):
            raise ParameterError("pulses_us", self.pulses_us, f"as many as angles_rad ({len(self.angles_rad)})")
        low, high = _PLAUSIBLE_US_PER_RAD
        for i in range(len(self.pulses_us) - 1):
            slope = (self.pulses_us[i + 1] - self.pulses_us[i]) / (self.angles_rad[i + 1] - self.angles_rad[i])
            if not low <= slope <= high:
                allowed = f"rising by {low:g} to {high:g} us per rad of angles_rad (sign: -1 reverses a servo)"
                raise ParameterError("pulses_us", self.pulses_us, allowed)
        if self.sign not in (1, -1):
            raise ParameterError("sign", self.sign, "1 or -1")
        if self.minimum_us >= self.maximum_us:
            raise ParameterError("maximum_us", self.maximum_us, f"more than minimum_us, {self.minimum_us:g} [us]")
        if self.lower_rad >= self.upper_rad:
            raise ParameterError("upper_rad", self.upper_rad, f"more than lower_rad, {self.lower_rad:g} [rad]")

    def pulse_us(self, joint_rad: float) -> float:
        """Return the pulse [us] for a joint angle [rad]; not limited."""
        return _interpolated(self.sign * joint_rad + self.trim_rad, self.angles_rad, self.pulses_us)

    def joint_rad(self, pulse_us: float) -> float:
        """Return the joint angle [rad] of a pulse [us]: the inverse of `pulse_us`."""
        return self.sign * (_interpolated(pulse_us, self.pulses_us, self.angles_rad) - self.trim_rad)

    def step_rad(self, resolution_us: float) -> float:
        """Return the largest angle [rad] between neighbouring pulses of a backend with this resolution [us]."""
        slopes = [
            (self.angles_rad[i + 1] - self.angles_rad[i]) / (self.pulses_us[i + 1] - self.pulses_us[i])
            for i in range(len(self.angles_rad) - 1)
        ]
        return resolution_us * max(slopes)

    def servo_spec(self, resolution_us: float, command_latency_s: float) -> ServoSpec:
        """Return the servo as `vergence_rig` models it, with the backend's real step."""
        return ServoSpec(
            name=self.model,
            speed_rad_s=self.speed_rad_s,
            dead_band_rad=self.dead_band_rad,
            pulse_step_rad=min(self.step_rad(resolution_us), 0.5),
            backlash_rad=self.backlash_rad,
            command_latency_s=command_latency_s,
        )


def _interpolated(x: float, xs: tuple[float, ...], ys: tuple[float, ...]) -> float:
    i = min(max(bisect.bisect_right(xs, x) - 1, 0), len(xs) - 2)
    return ys[i] + (x - xs[i]) * (ys[i + 1] - ys[i]) / (xs[i + 1] - xs[i])


def _preset(spec: ServoSpec) -> dict[str, Any]:
    return {
        "model": spec.name,
        "speed_rad_s": spec.speed_rad_s,
        "dead_band_rad": spec.dead_band_rad,
        "backlash_rad": spec.backlash_rad,
    }


PRESETS: dict[str, dict[str, Any]] = {spec.name: _preset(spec) for spec in (SG90, MG995)}
"""What `model: sg90` or `mg995` fills in: speed, dead band and backlash. Both turn about 0.09 degree per us; specimens
differ, hence calibrate_servos."""

DEFAULT: dict[str, dict[str, Any]] = {
    "pan_left": {"channel": 0, "model": "sg90"},
    "pan_right": {"channel": 1, "model": "sg90"},
    "tilt": {"channel": 2, "model": "mg995", "lower_rad": -45.0 * _DEG, "upper_rad": 45.0 * _DEG},
}
"""The built-in servos, equal to config/servos.yaml. Its channels match no real wiring: it serves only drivers without
hardware."""


def servos_from_mapping(document: Any) -> dict[str, ServoCalibration]:
    """Build the calibrations by joint name. Raises ServoCalibrationError."""
    if not isinstance(document, Mapping) or set(document) != {"servos"} or not isinstance(document["servos"], Mapping):
        raise ServoCalibrationError(f"the file must be 'servos:' with one mapping per joint: got {_short(document)}")
    servos: dict[str, ServoCalibration] = {}
    for joint, entries in document["servos"].items():
        if not isinstance(joint, str) or not isinstance(entries, Mapping):
            raise ServoCalibrationError(f"servos.{joint} must be a mapping of parameters: got {_short(entries)}")
        try:
            model = entries.get("model", "")
            preset = PRESETS.get(model, {}) if isinstance(model, str) else {}
            servos[joint] = ServoCalibration.from_mapping({**preset, **entries})
        except ParameterError as error:
            raise ServoCalibrationError(str(error.prefixed(f"servos.{joint}."))) from error
    if not servos:
        raise ServoCalibrationError("servos must have one mapping per joint: got none")
    check_channels({name: servo.backend for name, servo in servos.items()}, servos)
    return servos


def check_channels(backends: Mapping[str, str], servos: Mapping[str, ServoCalibration]) -> None:
    """Raise ServoCalibrationError where two of these joints have one channel of one backend (by joint)."""
    taken: dict[tuple[str, int], str] = {}
    for name, backend in backends.items():
        channel = servos[name].channel
        other = taken.setdefault((backend, channel), name)
        if other != name:
            of = f" of backend '{backend}'" if backend else ""
            raise ServoCalibrationError(
                f"each joint must have a different channel{of}: got {channel} for {other} and {name}"
            )


def default_servos() -> dict[str, ServoCalibration]:
    """Return the built-in servos."""
    return servos_from_mapping({"servos": DEFAULT})


def load_servos(path: str | Path) -> dict[str, ServoCalibration]:
    """Read servos.yaml; "" gives the built-in ones. Raises ServoCalibrationError."""
    if str(path) == "":
        return default_servos()
    try:
        return servos_from_mapping(read_yaml(path))
    except YamlFileError as error:
        raise ServoCalibrationError(f"servo file '{path}' {error}") from error
    except ServoCalibrationError as error:
        raise ServoCalibrationError(f"servo file '{path}': {error}") from error


def _short(value: object) -> str:
    text = shown(value)
    return text if len(text) < 80 else text[:77] + "..."


@dataclass(frozen=True)
class ServoLimits:
    """Limits of one servo: pulses [us] within both its own and its joint's limits, and a speed [rad/s]."""

    calibration: ServoCalibration
    minimum_us: float
    maximum_us: float
    max_speed_rad_s: float

    @property
    def lower_rad(self) -> float:
        """The smallest joint angle [rad]."""
        return min(self.calibration.joint_rad(self.minimum_us), self.calibration.joint_rad(self.maximum_us))

    @property
    def upper_rad(self) -> float:
        """The largest joint angle [rad]."""
        return max(self.calibration.joint_rad(self.minimum_us), self.calibration.joint_rad(self.maximum_us))


def servo_limits(name: str, calibration: ServoCalibration, joint: JointSpec | None = None) -> ServoLimits:
    """Return the limits that the servo's pulses, its soft limits and the rig's joint all allow.

    Raises ServoCalibrationError where nothing is left.
    """
    lower, upper, speed = calibration.lower_rad, calibration.upper_rad, calibration.speed_rad_s
    if joint is not None:
        lower, upper = max(lower, joint.lower_rad), min(upper, joint.upper_rad)
        speed = min(speed, joint.max_speed_rad_s)
    ends = sorted((calibration.pulse_us(lower), calibration.pulse_us(upper)))
    low_us, high_us = max(ends[0], calibration.minimum_us), min(ends[1], calibration.maximum_us)
    if lower >= upper or low_us >= high_us:
        raise ServoCalibrationError(
            f"servos.{name}: its pulses of {calibration.minimum_us:g} to {calibration.maximum_us:g} us, its soft "
            f"limits and the rig's joint limits ({lower:.3f} to {upper:.3f} rad) leave no range of motion"
        )
    return ServoLimits(calibration, low_us, high_us, speed)
