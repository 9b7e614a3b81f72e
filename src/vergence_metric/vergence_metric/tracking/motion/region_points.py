"""Where in space a moving region is: its matches in both eyes as rays, and their median point with its spread.

After Ding, Yan and We (2021, doi 10.3390/ijgi10040234), whose cameras are parallel: here the rays turn with the joints.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import EyeView
from vergence_metric.tracking.motion.correlation_pyramid import match_region
from vergence_metric.tracking.motion.moving_region import MovingRegion
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.tracked_target import disparity_of_parallax
from vergence_rig.kinematics import Kinematics

Array = NDArray[np.float64]

_NEAREST_RAD, _FARTHEST_RAD = 0.26, 0.0  # parallax: a quarter of a metre, and infinity
_DOWN_PX = 2  # of the reduced images: the epipolar band
_LEAST_MATCHES = 4
_TO_SIGMA = 1.4826  # of a median of absolute deviations


@dataclass(frozen=True)
class RegionPoints:
    """Points (N, 3) of a region in rig_base [m], their median and the spread about it (3,) [m], and its disparity [px].

    The spread is the median absolute deviation as a standard deviation.
    """

    points_m: Array
    center_m: Array
    spread_m: Array
    disparity_px: float
    vertical_px: float
    sigma_px: float


def region_points(region: MovingRegion, pair: StoredPair, kinematics: Kinematics) -> RegionPoints | str:
    """Return the points of a region of a pair's left image, or why there are none."""
    scale, middle = region.scale, 0.5 * (region.scale - 1.0)
    height, width = region.mask.shape
    small = [_reduced(image, (width, height)) for image in (pair.left, pair.right)]
    nearest, farthest = (
        disparity_of_parallax(parallax_rad, region.center_px, pair.views)
        for parallax_rad in (_NEAREST_RAD, _FARTHEST_RAD)
    )
    if nearest is None or farthest is None:
        return "the right eye cannot see it"
    d_range = (math.floor(farthest / scale) - 1, math.ceil(nearest / scale) + 1)
    matches = match_region(small[0], small[1], region.mask, d_range, _DOWN_PX)
    if len(matches.points_px) < _LEAST_MATCHES:
        return f"{len(matches.points_px)} of its patches match in the right eye"
    left_px = matches.points_px * scale + middle
    right_px = left_px - scale * np.column_stack([matches.across_px, matches.down_px])
    points = points_of_rays(pair.views, left_px, right_px, kinematics)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < _LEAST_MATCHES:
        return "the rays of its matches do not meet"
    center = np.median(points, axis=0)
    across = float(np.median(matches.across_px)) * scale
    spread = _TO_SIGMA * np.median(np.abs(points - center), axis=0)
    off = _TO_SIGMA * float(np.median(np.abs(matches.across_px * scale - across)))
    sigma = max(off / math.sqrt(len(points)), 0.3)
    return RegionPoints(points, center, spread, across, float(np.median(matches.down_px)) * scale, sigma)


def points_of_rays(views: tuple[EyeView, EyeView], left_px: Array, right_px: Array, kinematics: Kinematics) -> Array:
    """Return the points (N, 3) in rig_base [m] nearest to both rays of pixels (N, 2); NaN where they do not meet."""
    (first, u), (second, v) = (
        (kinematics.lens(eye == 0, view.pan_rad, view.tilt_rad), view.rays(pixels))
        for eye, (view, pixels) in enumerate(zip(views, (left_px, right_px), strict=True))
    )
    offset = second - first
    uv = np.einsum("ni,ni->n", u, v)
    with np.errstate(divide="ignore", invalid="ignore"):
        along_u = (u @ offset - uv * (v @ offset)) / (1.0 - uv**2)
        along_v = (uv * (u @ offset) - v @ offset) / (1.0 - uv**2)
    meet = (along_u > 0.0) & (along_v > 0.0)
    points = 0.5 * (first + along_u[:, None] * u + second + along_v[:, None] * v)
    return np.where(meet[:, None], points, np.nan)


def _reduced(image: Image, size: tuple[int, int]) -> Image:
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
