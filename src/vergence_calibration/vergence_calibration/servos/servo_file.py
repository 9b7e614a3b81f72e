"""servos.yaml as text."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import yaml

from vergence_servo.calibration import PRESETS, ServoCalibration, servos_from_mapping

_HEAD = "# Written by calibrate_servos; the old file is kept beside it. Keys: docs/servos.md\n"


def as_text(servos: Mapping[str, ServoCalibration]) -> str:
    """Return servos.yaml for these servos: every value that is neither the preset's nor the default."""
    document = {"servos": {name: _entries(servo) for name, servo in servos.items()}}
    servos_from_mapping(document)  # what is written can be read again
    return _HEAD + yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)


def _entries(servo: ServoCalibration) -> dict[str, Any]:
    filled_in = PRESETS.get(servo.model, {})
    entries: dict[str, Any] = {}
    for field in dataclasses.fields(servo):
        value = getattr(servo, field.name)
        given = field.default if field.name == "model" else filled_in.get(field.name, field.default)
        if field.name != "channel" and value == given:
            continue
        entries[field.name] = [round(v, 6) for v in value] if isinstance(value, tuple) else _rounded(value)
    return entries


def _rounded(value: Any) -> Any:
    return round(value, 6) if isinstance(value, float) else value
