"""One eye's camera at one moment: pixels to directions of rig_base and back."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from vergence_rig.camera import CameraModel
from vergence_rig.geometry import rotation_rig_from_optical

Pixel = tuple[float, float]


@dataclass(frozen=True)
class EyeView:
    """One eye's camera at its angles; converts its pixels to directions in rig_base and back.

    `pitch_rad` is that of the camera on its pan axis, > 0 down.
    """

    camera: CameraModel
    pan_rad: float
    tilt_rad: float
    pitch_rad: float = 0.0

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

    @cached_property
    def _rig_from_optical(self) -> np.ndarray:
        return rotation_rig_from_optical(self.pan_rad, self.tilt_rad, self.pitch_rad)


def distance(a: Pixel, b: Pixel) -> float:
    """Return the distance of two pixels [px]."""
    return math.hypot(a[0] - b[0], a[1] - b[1])
