"""rig.yaml: a rig as nested mappings, read and written."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml

from vergence_rig.parameters import ParameterError, Parameters, shown
from vergence_rig.rig import JOINT_NAMES, CameraSpec, EyeMount, Joints, JointSpec, Rig, RigError, default_rig
from vergence_rig.servo import PRESETS, ServoSpec
from vergence_rig.spelling import spelling_hint
from vergence_rig.yaml_file import YamlFileError, read_yaml

_NUMBERS = (
    "baseline_m",
    "tilt_axis_x_m",
    "tilt_axis_z_m",
    "zero_sigma_rad",
    "baseline_sigma_m",
    "minimum_vergence_rad",
)
_GROUPS = {
    "left_camera": CameraSpec(),
    "right_camera": CameraSpec(),
    "left_mount": EyeMount(),
    "right_mount": EyeMount(),
}
_JOINT_NUMBERS = ("lower_rad", "upper_rad", "max_speed_rad_s", "zero_rad", "scale")


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
    top = _mapping("rig", document, (*_NUMBERS, *_GROUPS, "joints", "identified"))
    joints = _mapping("joints", top.get("joints", {}), JOINT_NAMES)
    default = default_rig()
    numbers: dict[str, Any] = {key: _number(top, key, getattr(default, key)) for key in _NUMBERS}
    groups: dict[str, Any] = {key: _parameters(key, group, top.get(key, {})) for key, group in _GROUPS.items()}
    specs = (_joint(f"joints.{name}", default.joints[name], joints.get(name, {})) for name in JOINT_NAMES)
    return Rig(joints=Joints(*specs), **numbers, **groups)


def rig_as_mapping(rig: Rig) -> dict[str, Any]:
    """Return a rig as nested mappings for rig.yaml: the inverse of `rig_from_mapping`, with every key."""
    numbers = {key: getattr(rig, key) for key in _NUMBERS}
    groups = {key: _entries(getattr(rig, key)) for key in _GROUPS}
    return {**numbers, **groups, "joints": {name: _joint_entries(joint) for name, joint in rig.joints.items()}}


def write_rig(path: Path, rig: Rig) -> None:
    """Write a rig as a file that `load_rig` reads, with every key; its folder is made where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(rig_as_mapping(rig), sort_keys=False), encoding="utf-8")


def _joint_entries(joint: JointSpec) -> dict[str, Any]:
    servo = joint.servo.name if PRESETS.get(joint.servo.name) == joint.servo else _entries(joint.servo)
    return {**{key: getattr(joint, key) for key in _JOINT_NUMBERS}, "servo": servo}


def _entries(parameters: Parameters) -> dict[str, Any]:
    values = {spec.name: getattr(parameters, spec.name) for spec in parameters.specs()}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def _joint(key: str, default: JointSpec, value: Any) -> JointSpec:
    entries = _mapping(key, value, (*_JOINT_NUMBERS, "servo"))
    try:
        numbers = {name: _number(entries, name, getattr(default, name)) for name in _JOINT_NUMBERS}
        return JointSpec(servo=_servo(entries.get("servo", default.servo)), **numbers)
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
