"""An eye's image resampled over angles in which the epipolar lines of two eyes on one bar are rows.

With the y axis along the baseline, a point's epipolar plane is given by its angle about that axis, and its position in
the plane by its angle to the bar's middle plane (polar rectification, Pollefeys 1999). In these two angles a point lies
in the same row for both eyes, at any pan and with any epipoles, and patches of both differ by their slant only.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vergence_rig.camera import CameraModel
from vergence_rig.geometry import ROTATION_EYE_FROM_OPTICAL, rotation_rig_from_eye

Array = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.uint8]

_NODE_PX = 8
_HEIGHT_SHARE = 1.15
_OUTSIDE = -1e4


@dataclass(frozen=True)
class EpipolarView:
    """One eye's image over angles: `grey` (h, w) uint8, `seen` (h, w) bool inside the eye's image.

    Column x is the angle `aside_rad - (x - cx) * step_rad` to the left of the bar's middle plane, row y the angle
    `-(y - cy) * step_rad` upwards about the baseline; cx, cy is the middle of the view.
    """

    grey: Pixels
    seen: npt.NDArray[np.bool_]
    aside_rad: float
    step_rad: float
    bar_from_eye: Array

    def to_image_plane(self, points_px: npt.ArrayLike) -> Array:
        """Return normalised, undistorted coordinates (N, 2), x right, y down, of points (N, 2) of the view."""
        points = np.asarray(points_px, np.float64)
        rays = _rays(points, self.grey.shape, self.aside_rad, self.step_rad) @ self.bar_from_eye
        return np.asarray(-rays[:, 1:] / rays[:, :1])


def epipolar_view(
    grey: Pixels,
    camera: CameraModel,
    pan_rad: float,
    step_rad: float,
    eye_from_camera: Array = ROTATION_EYE_FROM_OPTICAL,
    size_px: tuple[int, int] | None = None,
) -> EpipolarView:
    """Return a grey image (h, w) of an eye panned by `pan_rad`, resampled over the bar's angles, `step_rad` a pixel.

    `eye_from_camera` (3, 3) is how the camera is turned on its pan axis, from its optical frame; `size_px` (width,
    height) is that of the image whose view has the same shape, by default this one.
    """
    columns, rows = size_px or (grey.shape[1], grey.shape[0])
    shape = (round(rows * _HEIGHT_SHARE), columns)
    bar_from_eye = rotation_rig_from_eye(pan_rad, 0.0)
    # The map from angles to pixels is smooth: it is computed at nodes and interpolated in between.
    down, across = (np.arange(0, size + _NODE_PX, _NODE_PX, dtype=np.float64) for size in shape)
    x, y = np.meshgrid(across, down)
    nodes = np.column_stack([x.ravel(), y.ravel()])
    rays = _rays(nodes, shape, pan_rad, step_rad) @ bar_from_eye
    pixels = camera.ray_to_pixel(rays @ eye_from_camera)
    pixels = np.nan_to_num(pixels, nan=_OUTSIDE).reshape(len(down), len(across), 2)
    maps = [_between(np.ascontiguousarray(pixels[:, :, axis]), shape) for axis in (0, 1)]
    drawn = cv2.remap(grey, maps[0], maps[1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    height, width = grey.shape
    seen = (maps[0] > 0) & (maps[0] < width - 1) & (maps[1] > 0) & (maps[1] < height - 1)
    return EpipolarView(np.asarray(drawn, np.uint8), seen, pan_rad, step_rad, bar_from_eye)


def _rays(points: Array, shape: tuple[int, ...], aside_rad: float, step_rad: float) -> Array:
    """Return unit rays (N, 3) in the bar's frame, x forward, y left, z up."""
    aside = aside_rad - (points[:, 0] - 0.5 * (shape[1] - 1)) * step_rad
    up = -(points[:, 1] - 0.5 * (shape[0] - 1)) * step_rad
    return np.column_stack([np.cos(aside) * np.cos(up), np.sin(aside), np.cos(aside) * np.sin(up)])


def _between(nodes: Array, shape: tuple[int, int]) -> npt.NDArray[np.float32]:
    """Return the values (h, w) between nodes at every _NODE_PX pixels."""
    scale = np.array([[_NODE_PX, 0.0, 0.0], [0.0, _NODE_PX, 0.0]])
    height, width = shape
    found = cv2.warpAffine(nodes.astype(np.float32), scale, (width, height), flags=cv2.INTER_LINEAR)
    return np.asarray(found, np.float32)
