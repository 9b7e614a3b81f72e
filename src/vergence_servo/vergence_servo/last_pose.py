"""The last pose, kept across runs: without feedback it is the best estimate of the servos' positions."""

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path

from vergence_rig.atomic_file import write_atomically
from vergence_rig.yaml_file import read_small_text


def default_pose_file() -> Path:
    """Return the file's default path, in $ROS_HOME or ~/.ros."""
    return Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "vergence_servo_pose.json"


def read_pose(path: Path) -> dict[str, float]:
    """Return the angles [rad] by joint; empty where the file is missing or not valid, without those beyond half a turn.

    Raises ValueError for a pipe, a folder or another thing that is no file: it could not be replaced by a pose either.
    """
    if path.exists() and not path.is_file():
        raise ValueError(f"parameter 'pose_file' must be the path of a regular file: got '{path}'")
    try:
        document = json.loads(read_small_text(path))
    except (ValueError, RecursionError):
        return {}
    if not isinstance(document, dict):
        return {}
    return {
        str(name): float(value)
        for name, value in document.items()
        if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= math.pi
    }


def write_pose(path: Path, pose_rad: Mapping[str, float]) -> None:
    """Write the angles [rad] by joint. Raises OSError."""
    write_atomically(path, json.dumps({name: round(value, 6) for name, value in pose_rad.items()}) + "\n")
