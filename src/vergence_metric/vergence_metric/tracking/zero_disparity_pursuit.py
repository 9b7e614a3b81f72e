"""Pursuit of whatever lies at one disparity: the zero-disparity filter's centroid, without any appearance.

After Coombs and Brown, "Real-time binocular smooth pursuit" (1993): features at the horopter belong to the target,
their centroid is the pursuit error, and the disparity inside keeps the eyes verged. The horopter is put where the
target was last, by its parallax, which eyes that turn do not change.
"""

import math
from functools import partial

import numpy as np

from vergence_metric.disparity.protocol import DisparityEstimator
from vergence_metric.tracking.direction_filter import DirectionFilter
from vergence_metric.tracking.eye_view import Pixel, is_inside
from vergence_metric.tracking.locking_tracker import LockingTracker
from vergence_metric.tracking.modelled_follower import Fix, modelled_tracker
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.saccade_detector import EyeMotion
from vergence_metric.tracking.segmentation import is_plausible, layer_tolerance_px
from vergence_metric.tracking.tracked_target import disparity_of_parallax, parallax
from vergence_metric.tracking.zero_disparity import ZeroDisparity, zero_disparity
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics

_SIGMA_PX = 2.0  # of a region's centroid
_REACH_PX = 20.0
_GROWTH = 1.6  # of a region's area, either way, beyond which it is another thing
_FILL_MOST = 0.6  # of the searched area: a wall


class ZeroDisparityPursuit:
    """The region at the target's disparity, and where its centroid is."""

    def __init__(
        self,
        pair: StoredPair,
        point: Pixel,
        region: ZeroDisparity,
        disparity_px: tuple[float, float],
        estimator: DisparityEstimator,
        parameters: TrackerParameters,
        baseline_m: float,
    ) -> None:
        self._estimator, self._parameters, self._baseline_m = estimator, parameters, baseline_m
        across, down = disparity_px
        self._parallax_rad = parallax(point, pair.views, (point[0] - across, point[1] - down))
        self._down_px, self._area_px, self._stamp_s = down, region.area_px, pair.stamp_s
        sigma_rad = _SIGMA_PX / pair.views[0].camera.fx_px
        self._center = DirectionFilter(pair.views[0].angles(np.array([region.centroid_px])), sigma_rad)
        self.region = region
        """The region in the last pair in which there was one."""

    def locate(self, pair: StoredPair, hidden_s: float, motion: EyeMotion) -> Fix | str:
        """Return where the region's centroid is in the next pair; see `modelled_follower.TargetModel`."""
        elapsed_s = pair.stamp_s - self._stamp_s
        hidden, self._stamp_s = hidden_s > elapsed_s + 1e-6, pair.stamp_s
        self._center.predict(elapsed_s, coasting=hidden)
        x, y = pair.views[0].pixels(self._center.angles)[0].tolist()
        if not is_inside((x, y), pair.left):
            return "it is predicted outside the left image"
        expected_px = disparity_of_parallax(self._parallax_rad, (x, y), pair.views)
        if expected_px is None:
            return "the right eye cannot see it"
        p = self._parameters
        reach_px = _REACH_PX if not hidden else p.search_px + p.search_growth_px_s * hidden_s
        region = _region(pair, (x, y), (expected_px, self._down_px), p, self._baseline_m, min(reach_px, p.region_px))
        if isinstance(region, str):
            return region
        growth = region.area_px / self._area_px
        # Nothing else says whose features these are. One that has grown may have joined another thing at its depth.
        if growth < 1.0 / _GROWTH or (hidden and growth > _GROWTH):
            return f"the region at its disparity has {growth:.1f} times its area"
        center = region.centroid_px
        disparity = self._estimator.estimate(pair.left, pair.right, center, expected_px)
        if not is_plausible(disparity, expected_px, p.disparity_jump_px):
            disparity_px, down_px, sigma_px = math.nan, math.nan, math.nan
            reason = disparity.reason or "the disparity inside differs"
        else:
            disparity_px, down_px = disparity.horizontal_px, disparity.vertical_px
            sigma_px, reason = disparity.sigma_px, ""
            self._parallax_rad = parallax(center, pair.views, (center[0] - disparity_px, center[1] - down_px))
            self._down_px = down_px
        angles = pair.views[0].angles(np.array([center]))
        if hidden:
            self._center.restart(np.array([0]), angles, np.zeros(2))
        else:
            self._center.update(np.array([0]), angles)
        self._area_px += round(0.2 * (region.area_px - self._area_px))
        self.region = region
        confidence = min(region.features / max(0.5 * region.area_px, 1.0), 1.0)
        return Fix(center, disparity_px, down_px, sigma_px, region.extent_px, confidence, reason)


def _region(
    pair: StoredPair,
    point: Pixel,
    disparity_px: tuple[float, float],
    parameters: TrackerParameters,
    baseline_m: float,
    reach_px: float,
) -> ZeroDisparity | str:
    """Return the region of a disparity at or near a point, or why there is none."""
    tolerance_px = layer_tolerance_px(disparity_px[0], pair.views, baseline_m)
    side_px = parameters.region_px
    region = zero_disparity(pair.left, pair.right, point, disparity_px, tolerance_px, side_px, reach_px)
    if not region.found:
        return "nothing lies at its disparity"
    if region.area_px > _FILL_MOST * region.mask.size:
        return "what lies at its disparity fills the view"
    return region


def learn_zero_disparity(
    pair: StoredPair,
    point: Pixel,
    _extent_px: tuple[float, float] | None,
    *,
    estimator: DisparityEstimator,
    parameters: TrackerParameters,
    baseline_m: float,
) -> ZeroDisparityPursuit | str:
    """Return the region at a point's disparity, or why there is none; see `modelled_follower.Learn`."""
    disparity = estimator.estimate(pair.left, pair.right, point)
    if math.isnan(disparity.horizontal_px):
        return f"it has no disparity: {disparity.reason}"
    across, down = disparity.horizontal_px, disparity.vertical_px
    region = _region(pair, point, (across, down), parameters, baseline_m, parameters.snap_px)
    if isinstance(region, str):
        return region
    return ZeroDisparityPursuit(pair, point, region, (across, down), estimator, parameters, baseline_m)


def zero_disparity_tracker(
    parameters: TrackerParameters, estimator: DisparityEstimator, camera: CameraModel, kinematics: Kinematics
) -> LockingTracker:
    """Return the tracker `zero_disparity`; see `protocol.Tracker`."""
    learn = partial(learn_zero_disparity, estimator=estimator, parameters=parameters, baseline_m=kinematics.baseline_m)
    return modelled_tracker(learn, estimator, parameters, camera, kinematics)
