"""A rectified pair of photographs with the camera matrix that is assumed for both, and the points whose depth is known.

Any matrix is consistent: another one shows a projectively changed scene, in which both eyes still agree.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import EyeAngles, eye_direction
from vergence_rig.picture_file import read_picture
from vergence_rig.regular_file import FileError
from vergence_rig.rig import CameraSpec
from vergence_sim.photo.views import Padded, padded

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]

_FINEST = 1.25
_TILT_STEPS = 20
FOCAL_PER_WIDTH = 0.85
"""Focal length over image width that is assumed where none is given: a webcam's, about 61 degrees wide."""


class PhotoError(ValueError):
    """Photographs or points that cannot serve as a world."""


@dataclass(frozen=True)
class PhotoPoint:
    """A pixel (x, y) of the left photograph and its disparity x_left - x_right [px], NaN where it is not known.

    Without a disparity only the left eye's ray, and with it the tilt, is known; what needs the right one's is NaN.
    """

    x_px: float
    y_px: float
    disparity_px: float = math.nan

    @property
    def depth_known(self) -> bool:
        """True if the disparity is known."""
        return math.isfinite(self.disparity_px)


class PhotoPair:
    """Both photographs (h, w, 3) BGR and their common camera: one focal length and principal point [px]."""

    def __init__(
        self,
        left: Image,
        right: Image,
        fx_px: float = 0.0,
        cx_px: float | None = None,
        cy_px: float | None = None,
    ) -> None:
        """Take photographs of one size; `fx_px` 0 is 0.85 of the width, no principal point is the picture's centre."""
        for name, image in (("left", left), ("right", right)):
            if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
                raise PhotoError(f"the {name} photograph must be (h, w, 3) uint8: got {image.shape} {image.dtype}")
        if left.shape != right.shape:
            raise PhotoError(
                f"both photographs must have one size: left is {_size(left)}, right is {_size(right)} px. "
                "Only a rectified pair, cut alike, is a world"
            )
        self.left, self.right = left, right
        self.height_px, self.width_px = left.shape[:2]
        self.fx_px = fx_px if fx_px > 0 else FOCAL_PER_WIDTH * self.width_px
        self.cx_px = 0.5 * (self.width_px - 1) if cx_px is None else cx_px
        self.cy_px = 0.5 * (self.height_px - 1) if cy_px is None else cy_px

    def seen_at(self, focal_px: float) -> tuple[Padded, Padded, Array]:
        """Return both photographs, with a margin for views that reach beyond them, and their camera matrix (3, 3).

        Much larger ones are reduced to views of this focal length: a view takes single pixels, so that their fine
        texture would turn into noise.
        """
        scale = min(1.0, _FINEST * focal_px / self.fx_px)
        size = max(round(scale * self.width_px), 1), max(round(scale * self.height_px), 1)
        if size == (self.width_px, self.height_px):
            return (*self._padded, self.matrix)
        across, down = size[0] / self.width_px, size[1] / self.height_px
        # Pixels are squares about whole coordinates, so that the picture's corner is at -0.5.
        reduced = np.array([[across, 0.0, 0.5 * (across - 1)], [0.0, down, 0.5 * (down - 1)], [0.0, 0.0, 1.0]])
        left, right = (
            padded(np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8))
            for image in (self.left, self.right)
        )
        return left, right, reduced @ self.matrix

    @cached_property
    def _padded(self) -> tuple[Padded, Padded]:
        return padded(self.left), padded(self.right)

    @property
    def matrix(self) -> Array:
        """The camera matrix (3, 3)."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fx_px, self.cy_px], [0.0, 0.0, 1.0]])

    def rays(self, point: PhotoPoint) -> tuple[Array, Array]:
        """Return the directions (3,), (3,) in rig_base in which the left and the right eye see a point."""
        y = (point.y_px - self.cy_px) / self.fx_px
        left, right = ((x - self.cx_px) / self.fx_px for x in (point.x_px, point.x_px - point.disparity_px))
        # Straight ahead, an eye's optical frame (x right, y down, z forward) is rig_base's (-y, -z, x).
        return np.array([1.0, -left, -y]), np.array([1.0, -right, -y])

    def fixation(self, point: PhotoPoint, pitch_rad: float = 0.0) -> EyeAngles:
        """Return the angles that bring a point to both foveas, of eyes whose axes are pitched on their pan axes [rad].

        Both rays share one tilt. Pitched eyes at different pans do not quite: the mean of both is level then.
        """
        (_, left, up), (_, right, _) = (ray.tolist() for ray in self.rays(point))
        tilt = math.atan2(-up, 1.0) - pitch_rad
        lateral = (left, right) if point.depth_known else (left,)
        pans, down = _on_bar(lateral, up, tilt)
        for _ in range(_TILT_STEPS if pitch_rad else 0):
            tilt += down - pitch_rad
            pans, down = _on_bar(lateral, up, tilt)
        return EyeAngles(pans[0], pans[1] if point.depth_known else math.nan, tilt)

    def on_axes(self, angles: EyeAngles) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the pixels (x, y), (x, y) of the left and the right photograph on the eyes' pan directions."""
        pixels = []
        for pan in (angles.pan_left_rad, angles.pan_right_rad):
            x, y, z = eye_direction(pan, angles.tilt_rad).tolist()
            pixels.append((self.cx_px - self.fx_px * y / x, self.cy_px - self.fx_px * z / x))
        return pixels[0], pixels[1]

    def start_towards(
        self, point: PhotoPoint, camera: CameraSpec, margin_px: float, pitch_rad: float = 0.0
    ) -> EyeAngles:
        """Return parallel eyes straight ahead, or the nearest such pose that shows a point to the eyes.

        It is shown at least `margin_px` from the border of an image of `camera`; a point without a disparity to the
        left eye alone. As the right eye turns with the left one, the vergence at the start says nothing of the point.
        """
        wanted = self.fixation(point, pitch_rad)
        across = math.atan((0.5 * camera.width_px - margin_px) / camera.fx_px)
        down = math.atan((0.5 * camera.height_px - margin_px) / camera.fy_px)
        pans = (wanted.pan_left_rad, wanted.pan_right_rad) if point.depth_known else (wanted.pan_left_rad,)
        pan = min(max(0.0, max(pans) - across), min(pans) + across)
        tilt = min(max(0.0, wanted.tilt_rad - down), wanted.tilt_rad + down)
        return EyeAngles(pan, pan, tilt)

    def check(self, point: PhotoPoint) -> None:
        """Raise PhotoError for a point outside either photograph."""
        right_x = point.x_px - point.disparity_px
        inside = 0 <= point.x_px <= self.width_px - 1 and 0 <= point.y_px <= self.height_px - 1
        if not (inside and (0 <= right_x <= self.width_px - 1 or not point.depth_known)):
            raise PhotoError(
                f"a point must lie inside both photographs of {self.width_px}x{self.height_px} px: got "
                f"x {point.x_px:g}, y {point.y_px:g}, disparity {point.disparity_px:g} (x {right_x:g} in the right one)"
            )


def read_pair(
    left: str | Path, right: str | Path, fx_px: float = 0.0, cx_px: float | None = None, cy_px: float | None = None
) -> PhotoPair:
    """Read two picture files; raises PhotoError for one that cannot be read, or for two sizes."""
    return PhotoPair(_read("left", left), _read("right", right), fx_px, cx_px, cy_px)


def _on_bar(lateral: tuple[float, ...], up: float, tilt_rad: float) -> tuple[list[float], float]:
    """Return the pans and the mean angle below the tilted bar's plane of directions (1, lateral, up) [rad]."""
    cos, sin = math.cos(tilt_rad), math.sin(tilt_rad)
    forward, above = cos - sin * up, sin + cos * up
    pans = [math.atan2(y, forward) for y in lateral]
    downs = [math.atan2(-above, math.hypot(forward, y)) for y in lateral]
    return pans, sum(downs) / len(downs)


def _read(side: str, path: str | Path) -> Image:
    if not str(path):
        raise PhotoError(f"the {side} photograph must be given: set the parameter '{side}' to the path of a picture")
    try:
        return read_picture(path)
    except FileError as error:
        raise PhotoError(f"the {side} photograph '{path}' {error}") from error


def _size(image: Image) -> str:
    return f"{image.shape[1]}x{image.shape[0]}"
