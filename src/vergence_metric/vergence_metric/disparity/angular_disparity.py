"""Disparity in pixels becomes disparity in angle, by both eyes' camera models."""

import math
from dataclasses import dataclass

from vergence_rig.camera import CameraModel


@dataclass(frozen=True)
class AngularDisparity:
    """Disparity of one point without lens distortion.

    `horizontal_px` is x_left - x_right and `vertical_px` y_left - y_right in pixels of the left camera; `*_rad` are the
    differences of azimuth (atan(x/z), right positive) and of elevation (atan(y/z), down positive).
    """

    horizontal_px: float
    vertical_px: float
    horizontal_rad: float
    vertical_rad: float


def angular_disparity(
    left: CameraModel, right: CameraModel, point_px: tuple[float, float], horizontal_px: float, vertical_px: float
) -> AngularDisparity:
    """Return the disparity of the raw left pixel `point_px` (x, y), seen at that less the disparity in the right image.

    NaN in, NaN out; NaN too where a lens model does not reach.
    """
    if not all(map(math.isfinite, (*point_px, horizontal_px, vertical_px))):
        return AngularDisparity(math.nan, math.nan, math.nan, math.nan)
    x_px, y_px = point_px
    x_left, y_left = left.undistorted(x_px, y_px)
    x_right, y_right = right.undistorted(x_px - horizontal_px, y_px - vertical_px)
    return AngularDisparity(
        horizontal_px=left.fx_px * (x_left - x_right),
        vertical_px=left.fy_px * (y_left - y_right),
        horizontal_rad=math.atan(x_left) - math.atan(x_right),
        vertical_rad=math.atan(y_left) - math.atan(y_right),
    )
