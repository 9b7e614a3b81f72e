"""From eye angles to the point of fixation, and back.

`rig_base` has x forward, y left, z up; its origin lies midway between the eyes on the tilt axis, the left eye at
+baseline/2 on y. The bar tilts first (about y, tilt > 0 looks down), then each eye pans (pan > 0 looks left): Helmholtz
angles, so that both axes always lie in one plane. vergence = pan_right - pan_left, version is their mean.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_PARALLEL_RAD = 1e-7


class GeometryError(ValueError):
    """A geometry without a solution."""


class ParallelAxesError(GeometryError):
    """The two axes are parallel: they meet at infinity."""


class DivergingAxesError(GeometryError):
    """The two axes diverge: they would meet behind the eyes."""


class UnreachableError(GeometryError):
    """No pair of eye angles reaches this direction or point."""


@dataclass(frozen=True)
class EyeAngles:
    """The three joint angles [rad]."""

    pan_left_rad: float
    pan_right_rad: float
    tilt_rad: float

    @property
    def version_rad(self) -> float:
        """Mean pan of the eyes [rad]."""
        return 0.5 * (self.pan_left_rad + self.pan_right_rad)

    @property
    def vergence_rad(self) -> float:
        """Angle between the axes [rad], positive converges."""
        return self.pan_right_rad - self.pan_left_rad

    def as_dict(self) -> dict[str, float]:
        """Return the angles by joint name."""
        return {"pan_left": self.pan_left_rad, "pan_right": self.pan_right_rad, "tilt": self.tilt_rad}


@dataclass(frozen=True)
class Fixation:
    """Where two axes meet: the midpoint of their closest approach in rig_base (3,) [m] and their distance there."""

    point_m: Array
    miss_distance_m: float

    @property
    def distance_m(self) -> float:
        """From the midpoint between the eyes [m]."""
        return float(np.linalg.norm(self.point_m))


def from_version_vergence(version_rad: float, vergence_rad: float, tilt_rad: float) -> EyeAngles:
    """Return the eye angles of a version, vergence and tilt [rad]."""
    return EyeAngles(version_rad - 0.5 * vergence_rad, version_rad + 0.5 * vergence_rad, tilt_rad)


def eye_direction(pan_rad: float, tilt_rad: float) -> Array:
    """Return the unit optical axis in rig_base (3,) of an eye at these angles [rad]."""
    cos_pan = math.cos(pan_rad)
    return np.array([math.cos(tilt_rad) * cos_pan, math.sin(pan_rad), -math.sin(tilt_rad) * cos_pan])


def rotation_rig_from_eye(pan_rad: float, tilt_rad: float) -> Array:
    """Return R_y(tilt) R_z(pan) (3, 3): its columns are the eye's x forward, y left, z up in rig_base."""
    sin_pan, cos_pan, sin_tilt, cos_tilt = math.sin(pan_rad), math.cos(pan_rad), math.sin(tilt_rad), math.cos(tilt_rad)
    return np.array(
        [
            [cos_tilt * cos_pan, -cos_tilt * sin_pan, sin_tilt],
            [sin_pan, cos_pan, 0.0],
            [-sin_tilt * cos_pan, sin_tilt * sin_pan, cos_tilt],
        ]
    )


ROTATION_EYE_FROM_OPTICAL: Array = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Optical frame (x right, y down, z forward) to eye frame (x forward, y left, z up)."""


def rotation_rig_from_optical(pan_rad: float, tilt_rad: float, pitch_rad: float = 0.0) -> Array:
    """Return the rotation (3, 3) from the optical frame of an eye, pitched on its pan axis, to rig_base."""
    turned = rotation_rig_from_eye(pan_rad, tilt_rad)
    return (turned @ rotation_rig_from_eye(0.0, pitch_rad) if pitch_rad else turned) @ ROTATION_EYE_FROM_OPTICAL


def point_at(version_rad: float, vergence_rad: float, tilt_rad: float, baseline_m: float) -> Array:
    """Return the point (3,) in rig_base [m] that both axes pass through; the inverse of `gaze_for_point`.

    Raises ParallelAxesError or DivergingAxesError.
    """
    pan_left = version_rad - 0.5 * vergence_rad
    pan_right = version_rad + 0.5 * vergence_rad
    check_converging(vergence_rad)
    cos_left, cos_right = math.cos(pan_left), math.cos(pan_right)
    if cos_left <= 0 or cos_right <= 0:
        raise DivergingAxesError(f"pans must be within a quarter turn: got {pan_left:g} and {pan_right:g} rad")
    # forward * tan(pan_right) - forward * tan(pan_left) = baseline, with the difference of tangents as a product
    forward = baseline_m * cos_left * cos_right / math.sin(vergence_rad)
    lateral = forward * math.tan(pan_left) + 0.5 * baseline_m
    return np.array([forward * math.cos(tilt_rad), lateral, -forward * math.sin(tilt_rad)])


def nearest_points_of_rays(origin_a: Any, direction_a: Any, origin_b: Any, direction_b: Any) -> tuple[Array, Array]:
    """Return the points (3,), (3,) of two rays that are closest to each other.

    Real mounts are never square, so real gaze rays do not intersect. Origins (3,) [m], directions (3,), any length.
    Raises ParallelAxesError, or DivergingAxesError where the closest approach lies behind either origin.
    """
    a, b = np.asarray(origin_a, dtype=np.float64), np.asarray(origin_b, dtype=np.float64)
    u = np.asarray(direction_a, dtype=np.float64) / np.linalg.norm(direction_a)
    v = np.asarray(direction_b, dtype=np.float64) / np.linalg.norm(direction_b)
    normal = _cross(u, v)
    sine_square = float(normal @ normal)
    if sine_square < _PARALLEL_RAD**2:
        raise ParallelAxesError(f"the rays are parallel to {math.sqrt(sine_square):.1e} rad: they meet at infinity")
    offset = b - a
    along_a = float(_cross(offset, v) @ normal) / sine_square
    along_b = float(_cross(offset, u) @ normal) / sine_square
    if along_a <= 0 or along_b <= 0:
        raise DivergingAxesError("the rays diverge: their closest approach is behind an eye")
    return a + along_a * u, b + along_b * v


def fixation_of_rays(origin_a: Any, direction_a: Any, origin_b: Any, direction_b: Any) -> Fixation:
    """Return the midpoint of closest approach of two rays and their distance. Raises as `nearest_points_of_rays`."""
    nearest_a, nearest_b = nearest_points_of_rays(origin_a, direction_a, origin_b, direction_b)
    return Fixation(0.5 * (nearest_a + nearest_b), float(np.linalg.norm(nearest_b - nearest_a)))


def angle_between(a: Any, b: Any) -> float:
    """Return the angle between two directions (3,) of any length [rad], exact for small ones too."""
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    return math.atan2(float(np.linalg.norm(_cross(first, second))), float(first @ second))


def check_converging(vergence_rad: float) -> None:
    """Raise ParallelAxesError or DivergingAxesError unless the axes of this vergence [rad] converge."""
    if not math.isfinite(vergence_rad):
        raise GeometryError(f"vergence must be a finite angle [rad]: got {vergence_rad!r}")
    if abs(vergence_rad) < _PARALLEL_RAD:
        raise ParallelAxesError(f"vergence is {vergence_rad:.1e} rad: the axes are parallel and meet at infinity")
    if vergence_rad < 0:
        raise DivergingAxesError(f"vergence is {vergence_rad:g} rad: the axes diverge")


def _cross(a: Array, b: Array) -> Array:
    """Return the cross product (3,) of two vectors (3,): np.cross is slow for single ones."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
