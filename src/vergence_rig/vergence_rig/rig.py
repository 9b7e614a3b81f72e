"""The rig: baseline, cameras, joints and limits, as rig.yaml describes them.

Every part is a frozen dataclass that validates itself; errors name the key, what it must be, and the value.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from vergence_rig.camera_limits import COEFFICIENTS, CameraLimitError, check_camera
from vergence_rig.parameters import ParameterError, Parameters, parameter, shown
from vergence_rig.servo import MG995, PRESETS, SG90, ServoSpec
from vergence_rig.spelling import spelling_hint
from vergence_rig.yaml_file import YamlFileError, read_yaml

JOINT_NAMES = ("pan_left", "pan_right", "tilt")
"""The three joints, in the order that commands carry them."""

_DEG = math.pi / 180.0


class RigError(ValueError):
    """An invalid rig description: the message names the key, what it must be, and the value."""


@dataclass(frozen=True)
class CameraSpec(Parameters):
    """One camera: image size, intrinsics and distortion in OpenCV's order (k1 k2 p1 p2 k3 ...)."""

    width_px: int = parameter(640, "image width", unit="px", minimum=16, maximum=16384)
    height_px: int = parameter(480, "image height", unit="px", minimum=16, maximum=16384)
    fx_px: float = parameter(539.0, "focal length along x", unit="px", minimum=1, maximum=1e5)
    fy_px: float = parameter(539.0, "focal length along y", unit="px", minimum=1, maximum=1e5)
    cx_px: float = parameter(319.5, "principal point, x", unit="px", minimum=-1e5, maximum=1e5)
    cy_px: float = parameter(239.5, "principal point, y", unit="px", minimum=-1e5, maximum=1e5)
    distortion: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0, 0.0, 0.0),
        "distortion coefficients in OpenCV's order, k1 k2 p1 p2 k3 ...",
        minimum=-100,
        maximum=100,
    )

    def check(self) -> None:
        """See Parameters."""
        if len(self.distortion) not in COEFFICIENTS["plumb_bob"]:
            allowed = "a list of five numbers (k1 k2 p1 p2 k3), or of 0, 4, 8, 12 or 14 in OpenCV's order"
            raise ParameterError("distortion", self.distortion, allowed)
        try:
            check_camera(
                self.width_px,
                self.height_px,
                (self.fx_px, self.fy_px, self.cx_px, self.cy_px),
                self.distortion,
                "plumb_bob",
            )
        except CameraLimitError as error:
            name = error.name if error.name == "distortion" else f"{error.name}_px"
            allowed = error.allowed.removeprefix("be ")
            raise ParameterError(name, getattr(self, name), allowed) from error


@dataclass(frozen=True)
class JointSpec:
    """One joint: its limits, the largest commanded speed, and its servo."""

    lower_rad: float
    upper_rad: float
    max_speed_rad_s: float
    servo: ServoSpec

    def __post_init__(self) -> None:
        half_turn = math.pi
        _check_number("lower_rad", self.lower_rad, -half_turn, half_turn, "rad")
        _check_number("upper_rad", self.upper_rad, -half_turn, half_turn, "rad")
        _check_number("max_speed_rad_s", self.max_speed_rad_s, 1e-3, 1e3, "rad/s")
        if self.lower_rad >= self.upper_rad:
            raise RigError(f"upper_rad must be more than lower_rad, {self.lower_rad!r} [rad]: got {self.upper_rad!r}")

    def clamp(self, angle_rad: float) -> float:
        """Return the angle [rad] held within the joint's limits."""
        return min(max(angle_rad, self.lower_rad), self.upper_rad)

    @property
    def speed_rad_s(self) -> float:
        """The speed that both the limit and the servo allow [rad/s]."""
        return min(self.max_speed_rad_s, self.servo.speed_rad_s)


def _pan(servo: ServoSpec = SG90) -> JointSpec:
    return JointSpec(-60.0 * _DEG, 60.0 * _DEG, 600.0 * _DEG, servo)


def _tilt(servo: ServoSpec = MG995) -> JointSpec:
    return JointSpec(-45.0 * _DEG, 45.0 * _DEG, 300.0 * _DEG, servo)


@dataclass(frozen=True)
class Joints:
    """The three joints: two pan servos on top of a tilt bar."""

    pan_left: JointSpec = field(default_factory=_pan)
    pan_right: JointSpec = field(default_factory=_pan)
    tilt: JointSpec = field(default_factory=_tilt)

    def __getitem__(self, name: str) -> JointSpec:
        if name not in JOINT_NAMES:
            raise KeyError(name)
        spec: JointSpec = getattr(self, name)
        return spec

    def items(self) -> tuple[tuple[str, JointSpec], ...]:
        """Return (name, joint) in the order of JOINT_NAMES."""
        return tuple((name, self[name]) for name in JOINT_NAMES)


@dataclass(frozen=True)
class Rig:
    """A binocular head: eyes at +-baseline_m / 2 on the y axis of `rig_base`, on top of one tilt bar."""

    baseline_m: float = 0.065
    left_camera: CameraSpec = field(default_factory=CameraSpec)
    right_camera: CameraSpec = field(default_factory=CameraSpec)
    joints: Joints = field(default_factory=Joints)
    minimum_vergence_rad: float = 0.0

    def __post_init__(self) -> None:
        _check_number("baseline_m", self.baseline_m, 1e-3, 10.0, "m")
        _check_number("minimum_vergence_rad", self.minimum_vergence_rad, 0.0, 0.5 * math.pi, "rad")
        widest_rad = self.pan_right.upper_rad - self.pan_left.lower_rad
        if self.minimum_vergence_rad >= widest_rad:
            raise RigError(
                f"minimum_vergence_rad must be less than the pan joints can reach, {widest_rad:g} [rad]: "
                f"got {self.minimum_vergence_rad!r}"
            )

    @property
    def pan_left(self) -> JointSpec:
        """The left eye's pan joint."""
        return self.joints.pan_left

    @property
    def pan_right(self) -> JointSpec:
        """The right eye's pan joint."""
        return self.joints.pan_right

    @property
    def tilt(self) -> JointSpec:
        """The joint of the bar that carries both eyes."""
        return self.joints.tilt

    def with_servos(self, pan: ServoSpec, tilt: ServoSpec | None = None) -> "Rig":
        """Return the same rig with other servos (`tilt`: the pans' if not given) and speed limits to match."""
        tilt = pan if tilt is None else tilt
        return Rig(
            self.baseline_m,
            self.left_camera,
            self.right_camera,
            Joints(
                *(
                    JointSpec(joint.lower_rad, joint.upper_rad, servo.speed_rad_s, servo)
                    for joint, servo in ((self.pan_left, pan), (self.pan_right, pan), (self.tilt, tilt))
                )
            ),
            self.minimum_vergence_rad,
        )


def default_rig() -> Rig:
    """Return the built-in rig, equal to config/rig.yaml."""
    return Rig()


def load_rig(path: str | Path) -> Rig:
    """Read a rig from YAML; "" gives the built-in one. Raises RigError."""
    if str(path) == "":
        return default_rig()
    try:
        document = read_yaml(path)
    except YamlFileError as error:
        raise RigError(f"rig file '{path}' {error}") from error
    try:
        return rig_from_mapping(document)
    except RigError as error:
        raise RigError(f"rig file '{path}': {error}") from error


def rig_from_mapping(document: Any) -> Rig:
    """Build a rig from nested mappings as in rig.yaml; what is left out keeps its default. Raises RigError.

    The key `identified` is the record written by `vergence identify`; it is ignored here.
    """
    keys = ("baseline_m", "left_camera", "right_camera", "joints", "minimum_vergence_rad", "identified")
    top = _mapping("rig", document, keys)
    joints = _mapping("joints", top.get("joints", {}), JOINT_NAMES)
    default = default_rig()
    return Rig(
        baseline_m=_number(top, "baseline_m", default.baseline_m),
        left_camera=_parameters("left_camera", CameraSpec(), top.get("left_camera", {})),
        right_camera=_parameters("right_camera", CameraSpec(), top.get("right_camera", {})),
        joints=Joints(*(_joint(f"joints.{name}", default.joints[name], joints.get(name, {})) for name in JOINT_NAMES)),
        minimum_vergence_rad=_number(top, "minimum_vergence_rad", default.minimum_vergence_rad),
    )


def rig_as_mapping(rig: Rig) -> dict[str, Any]:
    """Return a rig as nested mappings for rig.yaml: the inverse of `rig_from_mapping`, with every key."""
    return {
        "baseline_m": rig.baseline_m,
        "left_camera": _entries(rig.left_camera),
        "right_camera": _entries(rig.right_camera),
        "joints": {
            name: {
                "lower_rad": joint.lower_rad,
                "upper_rad": joint.upper_rad,
                "max_speed_rad_s": joint.max_speed_rad_s,
                "servo": joint.servo.name if PRESETS.get(joint.servo.name) == joint.servo else _entries(joint.servo),
            }
            for name, joint in rig.joints.items()
        },
        "minimum_vergence_rad": rig.minimum_vergence_rad,
    }


def _entries(parameters: Parameters) -> dict[str, Any]:
    values = {spec.name: getattr(parameters, spec.name) for spec in parameters.specs()}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def _joint(key: str, default: JointSpec, value: Any) -> JointSpec:
    entries = _mapping(key, value, ("lower_rad", "upper_rad", "max_speed_rad_s", "servo"))
    try:
        return JointSpec(
            _number(entries, "lower_rad", default.lower_rad),
            _number(entries, "upper_rad", default.upper_rad),
            _number(entries, "max_speed_rad_s", default.max_speed_rad_s),
            _servo(entries.get("servo", default.servo)),
        )
    except RigError as error:
        raise RigError(f"{key}.{error}") from error


def _servo(value: Any) -> ServoSpec:
    if isinstance(value, ServoSpec):
        return value
    if isinstance(value, str):
        if value not in PRESETS:
            known = ", ".join(repr(name) for name in PRESETS)
            raise RigError(f"servo must be one of {known}, or a mapping of its parameters: got {shown(value)}")
        return PRESETS[value]
    return _parameters("servo", ServoSpec(), value)


Spec = TypeVar("Spec", bound=Parameters)


def _parameters(key: str, default: Spec, value: Any) -> Spec:
    entries = _mapping(key, value, tuple(spec.name for spec in default.specs()))
    try:
        return default.replaced(**entries)
    except ParameterError as error:
        raise RigError(f"{key}.{error.name} must be {error.allowed}: got {shown(error.value)}{error.advice}") from error


def _mapping(key: str, value: Any, allowed: tuple[str, ...]) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise RigError(f"{key} must be a mapping with any of {', '.join(allowed)}: got {shown(value)}")
    for name in value:
        if name not in allowed:
            raise RigError(f"{key} must have no keys but {', '.join(allowed)}: got {shown(name)}")
    return value


def _number(entries: Mapping[str, Any], key: str, default: float) -> float:
    value = entries.get(key, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        hint = spelling_hint(float, False, None, value).replace("NAME", key)
        raise RigError(f"{key} must be a number: got {shown(value)}{hint and f'; {hint}'}")
    return float(value)


def _check_number(key: str, value: float, minimum: float, maximum: float, unit: str) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not minimum <= value <= maximum:
        raise RigError(f"{key} must be a number from {minimum:g} to {maximum:g} [{unit}]: got {shown(value)}")
