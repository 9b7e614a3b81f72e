"""A camera's calibration in the standard YAML of the ROS calibrators, and the path of a camera_info URL."""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import yaml

from vergence_rig.atomic_file import write_atomically
from vergence_rig.camera_limits import CameraModelError, check_camera
from vergence_rig.parameters import shown
from vergence_rig.regular_file import expanded
from vergence_rig.yaml_file import YamlFileError, read_yaml

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


class CameraCalibrationError(ValueError):
    """An invalid calibration: the message names the file, the entry, what it must be, and its value."""


@dataclass(frozen=True)
class Calibration:
    """Intrinsics of one camera. `k` (9), `r` (9) and `p` (12) are row by row; `d` fits `distortion_model`."""

    width_px: int
    height_px: int
    k: tuple[float, ...]
    d: tuple[float, ...]
    distortion_model: str = "plumb_bob"
    r: tuple[float, ...] = IDENTITY
    p: tuple[float, ...] = ()
    name: str = "camera"

    def __post_init__(self) -> None:
        object.__setattr__(self, "p", tuple(self.p) or self._monocular_projection())
        for entry, length in (("camera_matrix", 9), ("rectification_matrix", 9), ("projection_matrix", 12)):
            values = {"camera_matrix": self.k, "rectification_matrix": self.r, "projection_matrix": self.p}[entry]
            if len(values) != length or not all(math.isfinite(value) for value in values):
                raise CameraCalibrationError(f"{entry} must be {length} finite numbers: got {list(values)}")
        if self.width_px < 1 or self.height_px < 1:
            raise CameraCalibrationError(f"image size must be at least 1x1: got {self.width_px}x{self.height_px}")
        if not (self.k[0] > 0.0 and self.k[4] > 0.0):
            raise CameraCalibrationError(f"focal lengths must be above 0: got {self.k[0]:g}, {self.k[4]:g}")
        try:
            check_camera(
                self.width_px,
                self.height_px,
                (self.k[0], self.k[4], self.k[2], self.k[5]),
                self.d,
                self.distortion_model,
            )
        except CameraModelError as error:
            raise CameraCalibrationError(f"{self.name}: {error}") from error

    def _monocular_projection(self) -> tuple[float, ...]:
        k = self.k
        return (*k[0:3], 0.0, *k[3:6], 0.0, *k[6:9], 0.0)


def load_calibration(path: Path) -> Calibration:
    """Return the calibration in a YAML file; raise CameraCalibrationError if it is not one."""
    try:
        document = read_yaml(path)
    except YamlFileError as error:
        raise CameraCalibrationError(f"{path}: {error}") from None
    try:
        return _from_document(document)
    except CameraCalibrationError as error:
        raise CameraCalibrationError(f"{path}: {error}") from None


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write the calibration, whole or not at all; raise OSError if that cannot be done.

    A file there that is no calibration is kept beside it, with .bak at the end of its name.
    """
    if path.is_file():
        try:
            load_calibration(path)
        except CameraCalibrationError:
            path.replace(path.with_name(f"{path.name}.bak"))
    document = {
        "image_width": calibration.width_px,
        "image_height": calibration.height_px,
        "camera_name": calibration.name,
        "camera_matrix": _matrix(3, 3, calibration.k),
        "distortion_model": calibration.distortion_model,
        "distortion_coefficients": _matrix(1, len(calibration.d), calibration.d),
        "rectification_matrix": _matrix(3, 3, calibration.r),
        "projection_matrix": _matrix(3, 4, calibration.p),
    }
    write_yaml(document, path)


def write_yaml(document: dict[str, Any], path: Path) -> None:
    """Write a document so that no reader sees half of it; raise OSError if that cannot be done."""
    write_atomically(path, yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120))


def calibration_path(url: str, name: str, package_share: Callable[[str], str]) -> Path:
    """Return the path of a camera_info URL.

    Args:
        url: `file:///...` or `package://PACKAGE/...`; `${NAME}` and `${ROS_HOME}` are replaced. Empty means the default
            of ROS's camera drivers, `${ROS_HOME}/camera_info/${NAME}.yaml`.
        name: the camera's name.
        package_share: gives the share directory of a package; raises LookupError for an unknown one.

    Raises:
        CameraCalibrationError: another kind of URL, or an unknown package.
    """
    if not name or "/" in name or name.startswith("."):
        raise CameraCalibrationError(f"camera_name must be a name without '/' that begins with no '.': got {name!r}")
    ros_home = os.environ.get("ROS_HOME") or str(Path.home() / ".ros")
    filled = (url or "file://${ROS_HOME}/camera_info/${NAME}.yaml").replace("${ROS_HOME}", ros_home)
    filled = filled.replace("${NAME}", name)
    parts = urlsplit(filled)
    if parts.scheme == "file" and parts.netloc.startswith("~") and parts.path:
        return expanded(unquote(parts.netloc + parts.path))
    if parts.scheme == "file" and parts.netloc in ("", "localhost") and parts.path:
        return Path(unquote(parts.path))
    if parts.scheme == "package" and parts.netloc and parts.path:
        below = Path(unquote(parts.path).lstrip("/"))
        if ".." in below.parts:
            raise CameraCalibrationError(f"camera_info_url must lead into its package: got '{url}'")
        try:
            return Path(package_share(parts.netloc)) / below
        except LookupError as error:
            raise CameraCalibrationError(f"camera_info_url must name an installed package: got '{url}'") from error
    raise CameraCalibrationError(
        f"camera_info_url must be file:///PATH, file://~/PATH or package://PACKAGE/PATH: got '{url}'"
    )


def _matrix(rows: int, columns: int, data: Sequence[float]) -> dict[str, Any]:
    return {"rows": rows, "cols": columns, "data": [float(value) for value in data]}


def _from_document(document: Any) -> Calibration:
    if not isinstance(document, dict):
        raise CameraCalibrationError("the file must be a mapping of image_width, camera_matrix, ...")
    k = _numbers(document, "camera_matrix")
    return Calibration(
        width_px=_whole(document, "image_width"),
        height_px=_whole(document, "image_height"),
        name=_text(document, "camera_name", "camera"),
        k=k,
        d=_numbers(document, "distortion_coefficients"),
        distortion_model=_text(document, "distortion_model", "plumb_bob"),
        r=_numbers(document, "rectification_matrix") if "rectification_matrix" in document else IDENTITY,
        p=_numbers(document, "projection_matrix") if "projection_matrix" in document else (),
    )


def _text(document: dict[str, Any], entry: str, default: str) -> str:
    value = document.get(entry, default)
    if not isinstance(value, (str, int)) or isinstance(value, bool):
        raise CameraCalibrationError(f"{entry} must be a text: got {shown(value)}")
    return str(value)


def _whole(document: dict[str, Any], entry: str) -> int:
    value = document.get(entry)
    if not isinstance(value, int) or isinstance(value, bool):
        raise CameraCalibrationError(f"{entry} must be a whole number: got {shown(value)}")
    return value


def _numbers(document: dict[str, Any], entry: str) -> tuple[float, ...]:
    value = document.get(entry)
    data = value.get("data") if isinstance(value, dict) else None
    if not isinstance(data, list) or not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in data):
        raise CameraCalibrationError(
            f"{entry} must be a mapping with a list of numbers under 'data': got {shown(value)}"
        )
    return tuple(float(x) for x in data)
