"""One eye's camera at one moment: pixels to directions of rig_base and back."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import Image
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, rotation_rig_from_optical
from vergence_rig.kinematics import Kinematics

Pixel = tuple[float, float]
Points = NDArray[np.float64]


@dataclass(frozen=True)
class EyeView:
    """One eye's camera at its angles; converts its pixels to directions in rig_base and back.

    `pitch_rad` is that of the camera on its pan axis, > 0 down; `lens_m` is where the lens is in rig_base: one that
    lies off the axes moves as the eye turns.
    """

    camera: CameraModel
    pan_rad: float
    tilt_rad: float
    pitch_rad: float = 0.0
    lens_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def direction(self, pixel: Pixel) -> np.ndarray:
        """Return the unit direction (3,) in rig_base of a pixel."""
        x, y = self.camera.undistorted(*pixel)
        length = math.sqrt(x * x + y * y + 1.0)
        return np.asarray(self._rig_from_optical @ np.array((x / length, y / length, 1.0 / length)))

    def pixel(self, direction: np.ndarray) -> Pixel:
        """Return the pixel of a direction (3,) in rig_base; NaN behind the eye."""
        x, y, z = (direction @ self._rig_from_optical).tolist()
        if not z > 0.0:
            return math.nan, math.nan
        return self.camera.distorted(x / z, y / z)

    def direction_of(self, seen: np.ndarray, before: "EyeView", distance_m: float) -> np.ndarray:
        """Return the unit direction (3,) of what an earlier view saw in direction `seen` (3,) at a distance [m]."""
        if self.lens_m == before.lens_m or not math.isfinite(distance_m):
            return seen
        ray = np.asarray(seen) * distance_m + np.subtract(before.lens_m, self.lens_m)
        return np.asarray(ray / np.linalg.norm(ray))

    def rays(self, pixels: NDArray[np.floating]) -> Points:
        """Return the unit directions (N, 3) in rig_base of pixels (N, 2)."""
        rays = self.camera.pixel_to_ray(pixels) @ self._rig_from_optical.T
        return np.asarray(rays / np.linalg.norm(rays, axis=1)[:, None])

    def angles(self, pixels: NDArray[np.floating]) -> Points:
        """Return the angles (N, 2) in rig_base [rad] of pixels (N, 2): pan and tilt of an eye that fixates them."""
        rays = self.rays(pixels)
        return np.column_stack([np.arcsin(np.clip(rays[:, 1], -1.0, 1.0)), np.arctan2(-rays[:, 2], rays[:, 0])])

    def pixels(self, angles_rad: Points) -> Points:
        """Return the pixels (N, 2) of angles (N, 2) as `angles` returns them; NaN behind the eye."""
        pan, tilt = angles_rad.T
        cos_pan = np.cos(pan)
        rays = np.column_stack([np.cos(tilt) * cos_pan, np.sin(pan), -np.sin(tilt) * cos_pan])
        return np.asarray(self.camera.ray_to_pixel(rays @ self._rig_from_optical))

    def stretch(self, before: "EyeView", at_px: Points) -> Points:
        """Return what the turn from an earlier view makes of small steps about its pixel (2,), as a matrix (2, 2)."""
        steps = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
        there = self.pixels(before.angles(at_px + steps))
        matrix = (there[1:] - there[0]).T
        return matrix if np.isfinite(matrix).all() else np.eye(2)

    @cached_property
    def _rig_from_optical(self) -> np.ndarray:
        return rotation_rig_from_optical(self.pan_rad, self.tilt_rad, self.pitch_rad)


def eye_views(camera: CameraModel, eyes: EyeAngles, kinematics: Kinematics) -> tuple[EyeView, EyeView]:
    """Return both eyes' views, each of ideal images of `camera`, with a head's eyes at these angles."""

    def view(left: bool, pan_rad: float) -> EyeView:
        x, y, z = kinematics.lens(left, pan_rad, eyes.tilt_rad).tolist()
        return EyeView(camera, pan_rad, eyes.tilt_rad, kinematics.pitch_rad, (x, y, z))

    return view(True, eyes.pan_left_rad), view(False, eyes.pan_right_rad)


def distance(a: Pixel, b: Pixel) -> float:
    """Return the distance of two pixels [px]."""
    return math.hypot(a[0] - b[0], a[1] - b[1])


def is_inside(pixel: Pixel, image: Image) -> bool:
    """Return whether a pixel lies in an image (h, w); False for NaN."""
    return bool(0.0 <= pixel[0] <= image.shape[1] - 1 and 0.0 <= pixel[1] <= image.shape[0] - 1)
