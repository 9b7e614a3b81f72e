"""A tracker that follows what moves, and nothing else: the moving region nearest to where the target is predicted.

After Ding, Yan and We (2021, doi 10.3390/ijgi10040234). It has no appearance: a target that stops is lost, and the
track says so, until it moves again. What moves at another depth is something else.
"""

import math
from functools import partial

import numpy as np

from vergence_metric.disparity.protocol import DisparityEstimator
from vergence_metric.tracking.direction_filter import DirectionFilter
from vergence_metric.tracking.eye_view import Pixel, is_inside
from vergence_metric.tracking.locking_tracker import LockingTracker
from vergence_metric.tracking.modelled_follower import Fix, modelled_tracker
from vergence_metric.tracking.motion.moving_region import MotionDetector, MovingRegion
from vergence_metric.tracking.motion.region_points import RegionPoints, region_points
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.saccade_detector import EyeMotion
from vergence_metric.tracking.tracked_target import disparity_of_parallax, parallax
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics

_SIGMA_PX = 4.0  # of a region's centre
_REACH_PX = 30.0
_SURE_PX = 4.0  # flow from pair to pair that gives full confidence


class MovingTarget:
    """The region that moves about a requested point, in successive pairs."""

    def __init__(
        self,
        pair: StoredPair,
        point: Pixel,
        parallax_rad: float,
        parameters: TrackerParameters,
        kinematics: Kinematics,
    ) -> None:
        """Wait for what moves about a point; `parallax_rad` is the angle between both eyes' rays to it, or NaN."""
        self._parameters, self._kinematics, self._parallax_rad = parameters, kinematics, parallax_rad
        self._detector = MotionDetector()
        self._detector.update(pair.left, pair.views[0], pair.stamp_s)
        self._stamp_s = pair.stamp_s
        sigma_rad = _SIGMA_PX / pair.views[0].camera.fx_px
        self._center = DirectionFilter(pair.views[0].angles(np.array([point])), sigma_rad)
        self.region: MovingRegion | None = None
        """What moved in the last pair, None if nothing did."""
        self.points: RegionPoints | None = None
        """Where it was in space."""

    def locate(self, pair: StoredPair, hidden_s: float, motion: EyeMotion) -> Fix | str:
        """Return where what moves is in the next pair; see `modelled_follower.TargetModel`."""
        elapsed_s = pair.stamp_s - self._stamp_s
        hidden, self._stamp_s = hidden_s > elapsed_s + 1e-6, pair.stamp_s
        self._center.predict(elapsed_s, coasting=hidden)
        self.region = self.points = None
        view, p = pair.views[0], self._parameters
        x, y = view.pixels(self._center.angles)[0].tolist()
        inside = is_inside((x, y), pair.left)
        reach_px = _REACH_PX + min(p.search_growth_px_s * hidden_s, p.request_search_max_px)
        region = self._detector.update(pair.left, view, pair.stamp_s, (x, y) if inside else None, reach_px)
        if motion.saccading:
            return "in a saccade everything moves"
        if not inside:
            return "it is predicted outside the left image"
        if isinstance(region, str):
            return region
        points = region_points(region, pair, self._kinematics)
        if not isinstance(points, str):
            off_px = self._off_px(points, region.center_px, pair)
            if abs(off_px) > p.disparity_jump_px:
                return f"what moves is at another depth: its disparity differs by {off_px:+.1f} px"
        self.region = region
        angles = view.angles(np.array([region.center_px]))
        if hidden:
            self._center.restart(np.array([0]), angles, np.zeros(2))
        else:
            self._center.update(np.array([0]), angles)
        confidence = min(region.speed_px / _SURE_PX, 1.0)
        if isinstance(points, str):
            return Fix(region.center_px, math.nan, math.nan, math.nan, region.extent_px, confidence, points)
        self.points = points
        x, y = region.center_px
        self._parallax_rad = parallax((x, y), pair.views, (x - points.disparity_px, y - points.vertical_px))
        disparities = points.disparity_px, points.vertical_px, points.sigma_px
        return Fix(region.center_px, *disparities, region.extent_px, confidence)

    def _off_px(self, points: RegionPoints, center_px: Pixel, pair: StoredPair) -> float:
        """Return by how much a region's disparity differs from the target's [px], 0 where that is not known."""
        if math.isnan(self._parallax_rad):
            return 0.0
        expected_px = disparity_of_parallax(self._parallax_rad, center_px, pair.views)
        return 0.0 if expected_px is None else points.disparity_px - expected_px


def learn_moving_target(
    pair: StoredPair,
    point: Pixel,
    _extent_px: tuple[float, float] | None,
    *,
    estimator: DisparityEstimator,
    parameters: TrackerParameters,
    kinematics: Kinematics,
) -> MovingTarget:
    """Return what will be followed once it moves at a point of a pair; see `modelled_follower.Learn`."""
    found = estimator.estimate(pair.left, pair.right, point)
    right_px = (point[0] - found.horizontal_px, point[1] - found.vertical_px)
    parallax_rad = parallax(point, pair.views, right_px) if found.ok else math.nan
    return MovingTarget(pair, point, parallax_rad, parameters, kinematics)


def moving_target_tracker(
    parameters: TrackerParameters, estimator: DisparityEstimator, camera: CameraModel, kinematics: Kinematics
) -> LockingTracker:
    """Return the tracker `moving_target`; see `protocol.Tracker`."""
    learn = partial(learn_moving_target, estimator=estimator, parameters=parameters, kinematics=kinematics)
    return modelled_tracker(learn, estimator, parameters, camera, kinematics)
