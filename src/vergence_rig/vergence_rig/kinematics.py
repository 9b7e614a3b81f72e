"""From eye angles to camera poses and the point of fixation, and back, for a head as rig.yaml describes it.

Eye angles are the angles of the optical axes: each pan is its axis's angle plus the camera's yaw, the tilt is the
bar's (`Rig.eye_angles` gives them from the joints). In the frame of the tilted bar an eye's lens lies at
`axis + R_z(pan) lens` and its axis looks along R_z(pan) R_y(pitch) x, with one pitch, the mean of both cameras'. What
else a camera is turned by, its roll and half the difference of the pitches, is taken out of its images
(`vergence_rig.eye_image`), so that both axes can meet in one point.

Points are homogeneous where they may be far: (direction (3,) [m], w) is the point direction / w, at infinity for w = 0,
behind the eyes for w < 0. No formula here divides by w, so that all are smooth through infinity.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import (
    ROTATION_EYE_FROM_OPTICAL,
    DivergingAxesError,
    EyeAngles,
    Fixation,
    UnreachableError,
    check_converging,
    fixation_of_rays,
    rotation_rig_from_eye,
    rotation_rig_from_optical,
)
from vergence_rig.rig import EyeMount, Rig

Array = npt.NDArray[np.float64]
Place = tuple[float, float, float]

_STEPS = 12
_CONVERGED_RAD = 1e-12


@dataclass(frozen=True)
class FarPoint:
    """A point of rig_base that may be infinitely far: (x, y, z) / w [m]."""

    x: float
    y: float
    z: float
    w: float

    @property
    def point_m(self) -> Array:
        """The point (3,); raises DivergingAxesError unless it is in front and not at infinity."""
        if not self.w > 0.0:
            raise DivergingAxesError("the point must be at a finite distance in front of the eyes")
        return np.array([self.x, self.y, self.z]) / self.w


class _Eye:
    """One eye's axis and lens, as plain numbers: single points are computed many times a second."""

    def __init__(self, axis: Array, lens: Array) -> None:
        self.axis_x, self.axis_y, self.axis_z = axis.tolist()
        self.lens_x, self.lens_y, self.lens_z = lens.tolist()

    def lens_on_bar(self, pan_rad: float) -> Place:
        """Return the lens in the bar's frame [m]."""
        cos, sin = math.cos(pan_rad), math.sin(pan_rad)
        return (
            self.axis_x + cos * self.lens_x - sin * self.lens_y,
            self.axis_y + sin * self.lens_x + cos * self.lens_y,
            self.axis_z + self.lens_z,
        )

    def gaze(self, x: float, y: float, z: float, w: float) -> tuple[float, float]:
        """Return the pan [rad] that brings a point of the bar's frame into the lens's plane, and its angle down [rad].

        Raises UnreachableError for a point nearer to the pan axis than the lens's plane passes it.
        """
        x, y = x - w * self.axis_x, y - w * self.axis_y
        radius, aside = math.hypot(x, y), w * self.lens_y
        if not abs(aside) < radius:
            raise UnreachableError("the point must not lie on an eye's pan axis")
        pan = math.atan2(y, x) - math.asin(aside / radius)
        forward = math.sqrt(radius * radius - aside * aside) - w * self.lens_x
        return pan, math.atan2(-(z - w * (self.axis_z + self.lens_z)), forward)


class Kinematics:
    """A rig's geometry; immutable. Angles are eye angles, points and rotations in rig_base."""

    def __init__(self, rig: Rig) -> None:
        half = 0.5 * rig.baseline_m
        self._eyes = tuple(
            _Eye(
                np.array([mount.axis_x_m - rig.tilt_axis_x_m, side * half, mount.axis_z_m - rig.tilt_axis_z_m]),
                _turned(np.array([mount.lens_x_m, mount.lens_y_m, mount.lens_z_m]), -mount.yaw_rad),
            )
            for side, mount in ((1.0, rig.left_mount), (-1.0, rig.right_mount))
        )
        self._mounts = (rig.left_mount, rig.right_mount)
        self.baseline_m, self.baseline_sigma_m = rig.baseline_m, rig.baseline_sigma_m
        self.pitch_rad = rig.mean_pitch_rad
        """Of both eyes' axes on their pan axes [rad], > 0 down."""
        self._tilt_axis_x, self._tilt_axis_z = rig.tilt_axis_x_m, rig.tilt_axis_z_m

    def rotation_rig_from_eye(self, pan_rad: float, tilt_rad: float) -> Array:
        """Return R_y(tilt) R_z(pan) R_y(pitch) (3, 3): its columns are the eye's x forward, y left, z up."""
        turned = rotation_rig_from_eye(pan_rad, tilt_rad)
        return turned if self.pitch_rad == 0.0 else turned @ rotation_rig_from_eye(0.0, self.pitch_rad)

    def rotation_rig_from_optical(self, pan_rad: float, tilt_rad: float) -> Array:
        """Return the rotation (3, 3) from an eye's optical frame (x right, y down, z forward) to rig_base."""
        return rotation_rig_from_optical(pan_rad, tilt_rad, self.pitch_rad)

    def rotation_rig_from_camera(self, left: bool, pan_rad: float, tilt_rad: float) -> Array:
        """Return the rotation (3, 3) from the optical frame of a camera with its own roll and pitch to rig_base."""
        return rotation_rig_from_eye(pan_rad, tilt_rad) @ rotation_pan_from_camera(self._mounts[not left])

    def axis(self, pan_rad: float, tilt_rad: float) -> Array:
        """Return the unit optical axis (3,) of an eye."""
        return self.rotation_rig_from_eye(pan_rad, tilt_rad)[:, 0]

    def lens(self, left: bool, pan_rad: float, tilt_rad: float) -> Array:
        """Return where an eye's lens is (3,) [m]."""
        return np.array(self.lens_place(left, pan_rad, tilt_rad))

    def lens_place(self, left: bool, pan_rad: float, tilt_rad: float) -> Place:
        """Return what `lens` does as plain numbers."""
        return self._to_rig(*self._eyes[not left].lens_on_bar(pan_rad), 1.0, tilt_rad)

    def seen_direction(self, pan_rad: float, tilt_rad: float, right: float, down: float, forward: float) -> Place:
        """Return a direction of an eye's optical frame in rig_base, of the same length, as plain numbers."""
        x, y, z = forward, -right, -down
        if self.pitch_rad:
            cos, sin = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
            x, z = cos * x + sin * z, -sin * x + cos * z
        cos, sin = math.cos(pan_rad), math.sin(pan_rad)
        return self._to_rig(cos * x - sin * y, sin * x + cos * y, z, 0.0, tilt_rad)

    def pose_jacobian(self, left: bool, pan_rad: float, tilt_rad: float) -> tuple[Array, Array]:
        """Return how an eye's pose changes with its pan and the tilt.

        Returns: d lens / d (pan, tilt) (3, 2) [m/rad], and the rotation vectors of d (pan, tilt) in rig_base (3, 2).
        """
        cos, sin = math.cos(tilt_rad), math.sin(tilt_rad)
        turns = np.array([[sin, 0.0], [0.0, 1.0], [cos, 0.0]])
        eye = self._eyes[not left]
        lens = self.lens(left, pan_rad, tilt_rad)
        pan_axis = np.array(self._to_rig(eye.axis_x, eye.axis_y, eye.axis_z, 1.0, tilt_rad))
        tilt_axis = np.array([self._tilt_axis_x, 0.0, self._tilt_axis_z])
        moves = [np.cross(turns[:, 0], lens - pan_axis), np.cross(turns[:, 1], lens - tilt_axis)]
        return np.column_stack(moves), turns

    def fixation(self, eyes: EyeAngles) -> Fixation:
        """Return where the optical axes come closest. Raises ParallelAxesError or DivergingAxesError."""
        check_converging(eyes.vergence_rad)
        pans = ((True, eyes.pan_left_rad), (False, eyes.pan_right_rad))
        (a, u), (b, v) = ((self.lens(left, pan, eyes.tilt_rad), self.axis(pan, eyes.tilt_rad)) for left, pan in pans)
        return fixation_of_rays(a, u, b, v)

    def far_point(self, eyes: EyeAngles) -> FarPoint:
        """Return the point whose `gaze` these angles are, also where the axes are parallel or diverge."""
        x, y, z, w = self._on_bar(eyes.pan_left_rad, eyes.pan_right_rad)
        return FarPoint(*self._to_rig(x, y, z, w, eyes.tilt_rad), w)

    def point_at(self, version_rad: float, vergence_rad: float, tilt_rad: float) -> Array:
        """Return the point (3,) [m] at both eyes' axes. Raises ParallelAxesError or DivergingAxesError."""
        check_converging(vergence_rad)
        eyes = EyeAngles(version_rad - 0.5 * vergence_rad, version_rad + 0.5 * vergence_rad, tilt_rad)
        point = self.far_point(eyes)
        if not self._is_ahead(point, eyes):
            raise DivergingAxesError(
                f"the axes must meet before both eyes: pans {eyes.pan_left_rad:g} and {eyes.pan_right_rad:g} rad do not"
            )
        return point.point_m

    def point_jacobian(self, eyes: EyeAngles) -> Array:
        """Return d point / d (version, vergence, tilt) (3, 3) [m/rad]. Raises as `point_at`."""
        point_m = self.point_at(eyes.version_rad, eyes.vergence_rad, eyes.tilt_rad)
        per_pan = self._bar_jacobian(eyes.pan_left_rad, eyes.pan_right_rad)
        cos, sin = math.cos(eyes.tilt_rad), math.sin(eyes.tilt_rad)
        turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
        left, right = (turn @ per_pan).T
        x, _, z = (point_m - (self._tilt_axis_x, 0.0, self._tilt_axis_z)).tolist()
        return np.column_stack([left + right, 0.5 * (right - left), [z, 0.0, -x]])

    def gaze(self, point: FarPoint) -> EyeAngles:
        """Return the angles that bring a point to both foveas; where the lenses' heights differ, as near as they can.

        Raises UnreachableError for a point on an eye's pan axis or along the line through both eyes.
        """
        px, py, pz = point.x - point.w * self._tilt_axis_x, point.y, point.z - point.w * self._tilt_axis_z
        if not all(math.isfinite(value) for value in (px, py, pz, point.w)) or math.hypot(px, pz) <= 1e-9:
            raise UnreachableError(
                f"point must be finite and off the tilt axis: got ({point.x:g}, {point.y:g}, "
                f"{point.z:g}) / {point.w:g} m"
            )
        left, right = self._eyes
        tilt = math.atan2(-pz, px) - self.pitch_rad

        def at(tilt_rad: float) -> tuple[float, float, float]:
            cos, sin = math.cos(tilt_rad), math.sin(tilt_rad)
            x, z = cos * px - sin * pz, sin * px + cos * pz
            (pan_left, down_left), (pan_right, down_right) = (eye.gaze(x, py, z, point.w) for eye in (left, right))
            return pan_left, pan_right, 0.5 * (down_left + down_right) - self.pitch_rad

        pan_left, pan_right, error = at(tilt)
        slope = -1.0  # of the error over the tilt: tilting by an angle raises the point by about as much
        for _ in range(_STEPS):
            if abs(error) < _CONVERGED_RAD:
                break
            step = max(-0.5, min(0.5, -error / slope))
            before, tilt = error, tilt + step
            pan_left, pan_right, error = at(tilt)
            slope = (error - before) / step if error != before else slope
        else:
            if abs(error) > 1e-9:
                raise UnreachableError(
                    f"no tilt brings the point ({point.x:g}, {point.y:g}, {point.z:g}) / {point.w:g} m to the foveas"
                )
        return EyeAngles(pan_left, pan_right, math.remainder(tilt, math.tau))

    def gaze_for_point(self, point_m: Any) -> EyeAngles:
        """Return the angles that bring a point (3,) [m] to both foveas. Raises UnreachableError."""
        x, y, z = (float(value) for value in point_m)
        return self.gaze(FarPoint(x, y, z, 1.0))

    def vertical_difference_rad(self, point_m: Any) -> float:
        """Return how much lower the left eye sees a point (3,) [m] than the right one, once both look at it [rad]."""
        eyes = self.gaze_for_point(point_m)
        cos, sin = math.cos(eyes.tilt_rad), math.sin(eyes.tilt_rad)
        x, y, z = np.asarray(point_m, dtype=np.float64) - (self._tilt_axis_x, 0.0, self._tilt_axis_z)
        downs = [eye.gaze(cos * x - sin * z, y, sin * x + cos * z, 1.0)[1] for eye in self._eyes]
        return downs[0] - downs[1]

    def _on_bar(self, pan_left: float, pan_right: float) -> tuple[float, float, float, float]:
        """Return the homogeneous point of the bar's frame at both axes: their planes meet in an upright line."""
        planes = []
        for eye, pan in zip(self._eyes, (pan_left, pan_right), strict=True):
            sin, cos = math.sin(pan), math.cos(pan)
            # -sin x + cos y = offset holds on the axis's plane, which passes beside the pan axis by lens_y
            planes.append((-sin, cos, -sin * eye.axis_x + cos * eye.axis_y + eye.lens_y))
        (a, b, c), (d, e, f) = planes
        w = a * e - b * d
        x, y = c * e - b * f, a * f - c * d
        heights = []
        for eye, pan in zip(self._eyes, (pan_left, pan_right), strict=True):
            forward = (x - w * eye.axis_x) * math.cos(pan) + (y - w * eye.axis_y) * math.sin(pan) - w * eye.lens_x
            heights.append((w * (eye.axis_z + eye.lens_z), forward))
        # The tilt brings the mean of both eyes' angles to the pitch: both see the point half their difference off.
        z = self._height(heights)
        return x, y, z, w

    def _height(self, heights: list[tuple[float, float]]) -> float:
        (z_left, s_left), (z_right, s_right) = heights
        if self.pitch_rad == 0.0 and z_left == z_right:
            return z_left
        z = 0.5 * (z_left + z_right) - math.tan(self.pitch_rad) * 0.5 * (s_left + s_right)
        if min(s_left, s_right) <= 0.0:
            return z  # not before both eyes: no angle down
        reach = 0.5 * (s_left + s_right)
        for _ in range(_STEPS):
            down = 0.5 * (math.atan2(z_left - z, s_left) + math.atan2(z_right - z, s_right)) - self.pitch_rad
            slope = -0.5 * sum(s / (s * s + (h - z) ** 2) for h, s in heights)
            z += max(-reach, min(reach, -down / slope))
            if abs(down) < _CONVERGED_RAD:
                break
        return z

    def _bar_jacobian(self, pan_left: float, pan_right: float) -> Array:
        """Return d point / d (pan_left, pan_right) in the bar's frame (3, 2) [m/rad]."""
        x, y, z, w = self._on_bar(pan_left, pan_right)
        x, y, z = x / w, y / w, z / w
        pans = (pan_left, pan_right)
        # Each plane holds -sin x + cos y = offset; its change with its own pan moves the point within the other.
        normals = np.array([[-math.sin(pan), math.cos(pan)] for pan in pans])
        forward = [
            (x - eye.axis_x) * math.cos(pan) + (y - eye.axis_y) * math.sin(pan)
            for eye, pan in zip(self._eyes, pans, strict=True)
        ]
        flat = np.linalg.solve(normals, np.diag(forward))
        # The mean of the angles down stays the pitch.
        along, up, turn = np.zeros(2), 0.0, np.zeros(2)
        for i, (eye, pan) in enumerate(zip(self._eyes, pans, strict=True)):
            s, h = forward[i] - eye.lens_x, eye.axis_z + eye.lens_z - z
            square = s * s + h * h
            along += h / square * np.array([math.cos(pan), math.sin(pan)])
            up += s / square
            turn[i] = h / square * (-(x - eye.axis_x) * math.sin(pan) + (y - eye.axis_y) * math.cos(pan))
        return np.vstack([flat, -(along @ flat + turn) / up])

    def _is_ahead(self, point: FarPoint, eyes: EyeAngles) -> bool:
        for left, pan in ((True, eyes.pan_left_rad), (False, eyes.pan_right_rad)):
            offset = np.array([point.x, point.y, point.z]) - point.w * self.lens(left, pan, eyes.tilt_rad)
            if not float(offset @ self.axis(pan, eyes.tilt_rad)) > 0.0:
                return False
        return True

    def _to_rig(self, x: float, y: float, z: float, w: float, tilt_rad: float) -> Place:
        """Return a homogeneous point of the bar's frame, whose origin is on the tilt axis, in rig_base."""
        cos, sin = math.cos(tilt_rad), math.sin(tilt_rad)
        return cos * x + sin * z + w * self._tilt_axis_x, y, -sin * x + cos * z + w * self._tilt_axis_z


def rotation_pan_from_camera(mount: EyeMount) -> Array:
    """Return R_y(pitch) R_x(roll) (3, 3) from a camera's optical frame to the pan frame that is turned by its yaw."""
    sin, cos = math.sin(mount.roll_rad), math.cos(mount.roll_rad)
    roll = np.array([[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]])
    return rotation_rig_from_eye(0.0, mount.pitch_rad) @ roll @ ROTATION_EYE_FROM_OPTICAL


def _turned(vector: Array, angle_rad: float) -> Array:
    """Return R_z(angle) of a vector (3,)."""
    return rotation_rig_from_eye(angle_rad, 0.0) @ vector
