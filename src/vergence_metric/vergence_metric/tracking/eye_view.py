"""One eye's camera at one moment: pixels to directions of rig_base and back."""

import math
from dataclasses import dataclass

import numpy as np

from vergence_rig.camera import CameraModel
from vergence_rig.geometry import rotation_rig_from_optical

Pixel = tuple[float, float]


@dataclass(frozen=True)
class EyeView:
    """One eye's camera at its joint angles; converts its pixels to directions in rig_base and back."""

    camera: CameraModel
    pan_rad: float
    tilt_rad: float

    def direction(self, pixel: Pixel) -> np.ndarray:
        """Return the unit direction (3,) in rig_base of a pixel."""
        ray = self.camera.pixel_to_ray(np.array([pixel]))[0]
        return np.asarray(rotation_rig_from_optical(self.pan_rad, self.tilt_rad) @ ray)

    def pixel(self, direction: np.ndarray) -> Pixel:
        """Return the pixel of a direction (3,) in rig_base; NaN behind the eye."""
        ray = rotation_rig_from_optical(self.pan_rad, self.tilt_rad).T @ direction
        u, v = self.camera.ray_to_pixel(ray[None, :])[0]
        return float(u), float(v)


def distance(a: Pixel, b: Pixel) -> float:
    """Return the distance of two pixels [px]."""
    return math.hypot(a[0] - b[0], a[1] - b[1])
