"""What the numbers of a camera must be to describe a lens: checked wherever a calibration enters."""

import math
import sys
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

FOCAL_PER_SIZE = (0.1, 100.0)
"""Focal length over the image's width or height: a field of view from 0.6 to 157 degrees without distortion."""

CENTRE_PER_SIZE = (-1.0, 2.0)
"""Principal point over the image's width or height."""

_OPENCV = (0, 4, 5, 8, 12, 14)
COEFFICIENTS = {"": _OPENCV, "plumb_bob": _OPENCV, "rational_polynomial": _OPENCV, "equidistant": (4,)}
"""Numbers of distortion coefficients by `distortion_model`. In OpenCV's order (k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx
ty) the count says what they are, and drivers give either name."""

LARGEST_TILT_RAD = 0.5
"""Largest tilt of the sensor against the lens, about x and about y."""

RADIUS_RATIO = 2.0
"""Largest ratio, either way, of a ray's radius without and with distortion, where the image's nearer border lies."""

_SAMPLES = 301
_TANGENTIAL_SHARE = 0.5  # of the border's radius: largest displacement by p1 and p2 there


class CameraModelError(ValueError):
    """An invalid camera model: the message names the value, what it must be, and what was given."""


class CameraLimitError(CameraModelError):
    """A number of a camera that no lens has. `name` is fx, fy, cx, cy or distortion; `allowed` completes "must"."""

    def __init__(self, name: str, allowed: str, value: str) -> None:
        super().__init__(f"{name} must {allowed}: got {value}")
        self.name, self.allowed = name, allowed


def check_camera(
    width_px: int, height_px: int, intrinsics: Sequence[float], distortion: Sequence[float], model: str
) -> None:
    """Raise CameraModelError where no lens has these numbers.

    Args:
        width_px: width of the image [px].
        height_px: height of the image [px].
        intrinsics: fx, fy, cx, cy [px].
        distortion: coefficients in OpenCV's order.
        model: a key of COEFFICIENTS.
    """
    if model not in COEFFICIENTS:
        known = ", ".join(repr(name) for name in COEFFICIENTS if name)
        raise CameraModelError(f"distortion_model must be one of {known}: got {model!r}")
    if len(distortion) not in COEFFICIENTS[model]:
        counts = " or ".join(str(count) for count in COEFFICIENTS[model])
        raise CameraModelError(f"distortion must be {counts} values for '{model}': got {len(distortion)}")
    fx, fy, cx, cy = (float(value) for value in intrinsics)
    if fx == fy == 0:
        raise CameraModelError("the camera is not calibrated (fx and fy are 0): run vergence calibrate cameras")
    for focal, centre, size, axis in ((fx, cx, width_px, "x"), (fy, cy, height_px, "y")):
        _check_within(f"f{axis}", focal, FOCAL_PER_SIZE, size)
        _check_within(f"c{axis}", centre, CENTRE_PER_SIZE, size)
    coefficients = np.asarray(distortion, dtype=np.float64).reshape(-1)
    text = ", ".join(f"{value:g}" for value in coefficients)
    tiny = (coefficients != 0) & (np.abs(coefficients) < sys.float_info.min)
    if tiny.any() or not np.isfinite(coefficients).all():
        raise CameraLimitError("distortion", "be numbers that are finite and not denormal", f"[{text}]")
    border = 0.5 * min(width_px / fx, height_px / fy)
    if not _border_has_a_ray(coefficients, border, model):
        raise CameraLimitError(
            "distortion",
            f"be of a lens that moves the ray at the image's nearer border by a factor of at most {RADIUS_RATIO:g}",
            f"[{text}] ({model})",
        )


def _check_within(name: str, value: float, per_size: tuple[float, float], size_px: int) -> None:
    low, high = (share * size_px for share in per_size)
    if not low <= value <= high:  # also NaN
        allowed = f"be {low:g} to {high:g} [px] for an image of {size_px} px"
        raise CameraLimitError(name, allowed, f"{value:g}")


def _border_has_a_ray(coefficients: npt.NDArray[np.float64], border: float, model: str) -> bool:
    radii = np.linspace(0.0, min(RADIUS_RATIO * border, math.pi if model == "equidistant" else math.inf), _SAMPLES)
    square = radii * radii
    with np.errstate(all="ignore"):
        if model == "equidistant":
            k1, k2, k3, k4 = coefficients
            bent = radii * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
        else:
            k1, k2, p1, p2, k3, k4, k5, k6 = np.concatenate([coefficients, np.zeros(8)])[:8]
            prism = np.concatenate([coefficients, np.zeros(14)])[8:12]
            sideways = 3 * max(abs(p1), abs(p2)) + float(np.abs(prism) @ (1, border**2, 1, border**2))
            tilts = np.abs(coefficients[12:])
            if not sideways * border <= _TANGENTIAL_SHARE or (tilts > LARGEST_TILT_RAD).any():
                return False
            numerator = 1 + square * (k1 + square * (k2 + square * k3))
            bent = radii * numerator / (1 + square * (k4 + square * (k5 + square * k6)))
    beyond = np.flatnonzero(bent >= border)
    if not np.isfinite(bent).all() or not len(beyond) or radii[beyond[0]] < border / RADIUS_RATIO:
        return False
    return bool((np.diff(bent[: beyond[0] + 1]) > 0).all())
