"""Where one eye can see what the other sees, from the joint angles: epipolar lines and the disparity of infinity."""

import math
from dataclasses import dataclass

import numpy as np

from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics

Pixel = tuple[float, float]


@dataclass(frozen=True)
class PairGeometry:
    """Both cameras, the eye angles at the images' stamps, and the head's kinematics."""

    left: CameraModel
    right: CameraModel
    eyes: EyeAngles
    kinematics: Kinematics

    def direction(self, left_eye: bool, pixel: Pixel) -> np.ndarray:
        """Return the unit direction (3,) in rig_base of one eye's pixel."""
        camera = self.left if left_eye else self.right
        return np.asarray(self._rotation(left_eye) @ camera.pixel_to_ray([pixel])[0])

    def pixel(self, left_eye: bool, direction: np.ndarray) -> Pixel:
        """Return where an eye sees an infinitely far point in a direction (3,); NaN behind it."""
        camera = self.left if left_eye else self.right
        u, v = camera.ray_to_pixel((self._rotation(left_eye).T @ direction)[None])[0]
        return float(u), float(v)

    def parallel_px(self, left_px: Pixel) -> float:
        """Return the disparity of an infinitely far point at a left pixel; -inf where it is out of view."""
        u, _ = self.pixel(False, self.direction(True, left_px))
        return left_px[0] - u if math.isfinite(u) else -math.inf

    def parallax_rad(self, left_px: Pixel, right_px: Pixel) -> float:
        """Return by how much the right eye must be turned further to the left than the left one to see one point."""
        left, right = self.direction(True, left_px), self.direction(False, right_px)
        return math.atan2(right[1], right[0]) - math.atan2(left[1], left[0])

    def vertical_px(self, left_px: Pixel, right_x_px: float) -> float:
        """Return y_left - y_right of the point seen at a left pixel and at a column of the right image.

        Both eyes, and every point on the left ray, lie in one plane; it cuts the right image in a line.
        """
        baseline = self._lens(True) - self._lens(False)
        normal = self._rotation(False).T @ np.cross(baseline, self.direction(True, left_px))
        if abs(normal[1]) < 1e-6:
            return 0.0
        x = float(self.right.undistort([(right_x_px, left_px[1])])[0][0])
        y = -(normal[0] * x + normal[2]) / normal[1]
        v = float(self.right.distort([(x, y)])[0][1])
        return left_px[1] - v if math.isfinite(v) else 0.0

    def _lens(self, left_eye: bool) -> np.ndarray:
        return self.kinematics.lens(left_eye, self._pan_rad(left_eye), self.eyes.tilt_rad)

    def _rotation(self, left_eye: bool) -> np.ndarray:
        return self.kinematics.rotation_rig_from_optical(self._pan_rad(left_eye), self.eyes.tilt_rad)

    def _pan_rad(self, left_eye: bool) -> float:
        return self.eyes.pan_left_rad if left_eye else self.eyes.pan_right_rad
