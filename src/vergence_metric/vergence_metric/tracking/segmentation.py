"""The region of the object at a pixel: centre, extent and disparity, by the zero-disparity filter."""

import math
from typing import NamedTuple

from vergence_metric.disparity.protocol import Disparity, DisparityEstimator, DisparityStatus, Image
from vergence_metric.tracking.eye_view import EyeView, Pixel
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.zero_disparity import zero_disparity

_USUAL_DEPTH_M = 0.06
_MAX_AMBIGUOUS_JUMP_PX = 4.0


class Region(NamedTuple):
    """Centre (x, y) and extent (width, height) [px] of an object, with its disparity; extent None without bounds."""

    center_px: Pixel
    extent_px: tuple[float, float] | None
    disparity: Disparity


class Segmenter:
    """Segments the object at a pixel of the left image from its surroundings."""

    def __init__(self, parameters: TrackerParameters, estimator: DisparityEstimator, baseline_m: float) -> None:
        self._parameters = parameters
        self._estimator = estimator
        self._baseline_m = baseline_m

    def segment(
        self, left: Image, right: Image, point: Pixel, disparity: Disparity, views: tuple[EyeView, EyeView]
    ) -> Region:
        """Return the region of the object at a point with that disparity; the point itself where it has no bounds."""
        p = self._parameters
        if not disparity.ok:
            return Region(point, None, disparity)
        found = zero_disparity(
            left,
            right,
            point,
            (disparity.horizontal_px, disparity.vertical_px),
            layer_tolerance_px(disparity.horizontal_px, views, self._baseline_m),
            p.region_px,
            p.snap_px,
        )
        if not found.found or found.touches_border:
            return Region(point, None, disparity)
        if offset_inside(point, found.centroid_px, found.extent_px) == (0.0, 0.0):
            at_center = self._estimator.estimate(left, right, found.centroid_px, disparity.horizontal_px)
            if is_plausible(at_center, disparity.horizontal_px, p.disparity_jump_px):
                disparity = at_center
        return Region(found.centroid_px, found.extent_px, disparity)


def is_plausible(disparity: Disparity, expected_px: float | None, jump_px: float) -> bool:
    """Return whether a disparity can be the target's: a valid one, or an ambiguous one near the expected value."""
    if math.isnan(disparity.horizontal_px):
        return False
    if disparity.ok:
        return True
    near = expected_px is not None and abs(disparity.horizontal_px - expected_px) <= min(
        jump_px, _MAX_AMBIGUOUS_JUMP_PX
    )
    return disparity.status is DisparityStatus.AMBIGUOUS and near


def offset_inside(fixated: Pixel, center: Pixel, extent_px: tuple[float, float] | None) -> Pixel:
    """Return the offset of the fixated pixel from a region's centre; zero if it lies outside the region."""
    offset = (fixated[0] - center[0], fixated[1] - center[1])
    inside = extent_px is not None and all(abs(o) <= 0.5 * e for o, e in zip(offset, extent_px, strict=True))
    return offset if inside else (0.0, 0.0)


def layer_tolerance_px(disparity_px: float, views: tuple[EyeView, EyeView], baseline_m: float) -> int:
    """Return the variation of disparity over an object about as deep as wide."""
    f = views[0].camera.fx_px
    parallax_rad = views[1].pan_rad - views[0].pan_rad + disparity_px / f
    # d = f b / z, so a depth of s changes it by f b s / z^2 = d^2 s / (f b).
    change_px = f * max(parallax_rad, 0.0) ** 2 * _USUAL_DEPTH_M / baseline_m
    return round(min(max(0.5 * change_px, 1.0), 5.0))
