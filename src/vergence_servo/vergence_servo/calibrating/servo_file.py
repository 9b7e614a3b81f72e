"""Writing servos.yaml: what would change, atomically, with the old file kept."""

import dataclasses
import difflib
import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from vergence_servo.calibration import PRESETS, ServoCalibration, servos_from_mapping
from vergence_servo.last_pose import write_atomically

_HEAD = "# Written by calibrate_servos; the file before it lies beside it. Keys: docs/servos.md\n"


def as_text(servos: Mapping[str, ServoCalibration]) -> str:
    """Return servos.yaml for these servos: every figure that is neither the preset's nor the default."""
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


def difference(path: Path, text: str) -> str:
    """Return what would change in `path`, as a unified diff; empty where nothing would."""
    old = path.read_text(encoding="utf-8") if path.exists() else ""
    lines = difflib.unified_diff(old.splitlines(), text.splitlines(), str(path), f"{path} (new)", lineterm="")
    return "\n".join(lines)


def write(path: Path, text: str) -> Path | None:
    """Write `text` atomically; return where the old file is kept, None if there was none. Raises OSError."""
    kept: Path | None = None
    if path.exists():
        stamp = time.strftime("%Y%m%d-%H%M%S")
        kept = path.with_name(f"{path.name}.{stamp}.old")
        number = 1
        while kept.exists():
            kept = path.with_name(f"{path.name}.{stamp}-{number}.old")
            number += 1
        shutil.copy2(path, kept)
    write_atomically(path, text)
    return kept
