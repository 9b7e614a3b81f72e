"""The last known pose, kept across runs: without feedback it is the best guess of where the servos are."""

import json
import math
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path


def default_pose_file() -> Path:
    """Return where ROS keeps its own state: $ROS_HOME or ~/.ros."""
    return Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "vergence_servo_pose.json"


def read_pose(path: Path) -> dict[str, float]:
    """Return the angles [rad] by joint; empty where there is no such file or it holds something else."""
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


def write_atomically(path: Path, text: str) -> None:
    """Write a file so that a reader, or a power cut, meets the old one or the new one. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(prefix=path.name, dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        if path.exists():
            os.chmod(temporary, path.stat().st_mode & 0o777)
        else:
            os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_pose(path: Path, pose_rad: Mapping[str, float]) -> None:
    """Write the angles [rad] by joint. Raises OSError."""
    write_atomically(path, json.dumps({name: round(value, 6) for name, value in pose_rad.items()}) + "\n")
