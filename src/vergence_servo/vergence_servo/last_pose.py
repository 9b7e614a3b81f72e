"""The last pose, kept across runs: without feedback it is the best estimate of the servos' positions."""

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path

from vergence_rig.atomic_file import write_atomically


def default_pose_file() -> Path:
    """Return the file's default path, in $ROS_HOME or ~/.ros."""
    return Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "vergence_servo_pose.json"


def read_pose(path: Path) -> dict[str, float]:
    """Return the angles [rad] by joint; empty where the file is missing or not valid."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    if not isinstance(document, dict):
        return {}
    return {
        str(name): float(value)
        for name, value in document.items()
        if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    }


def write_pose(path: Path, pose_rad: Mapping[str, float]) -> None:
    """Write the angles [rad] by joint. Raises OSError."""
    write_atomically(path, json.dumps({name: round(value, 6) for name, value in pose_rad.items()}) + "\n")
