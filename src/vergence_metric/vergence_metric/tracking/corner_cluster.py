"""A target as a cluster of corners: each is followed by itself, and a fixed point is transferred by their structure.

After Reid and Murray, "Active tracking of foveated feature clusters using affine structure" (1996). In every pair
corners are found in the foveal window about the predicted point. Each known corner takes the nearest of them within its
filter's gate that looks like it. Before that all share one motion, which they vote for: the joint angles of hobby
servos are off by up to a degree after a move, and a hidden target may have gone on. Corners that are not seen stay
known, so that a target that was covered bit by bit is found again.
"""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import DisparityEstimator
from vergence_metric.tracking.affine_transfer import AffineCamera
from vergence_metric.tracking.common_motion import common_motion
from vergence_metric.tracking.corners import Patches, find_corners, match_right, patches_at
from vergence_metric.tracking.direction_filter import DirectionFilter
from vergence_metric.tracking.eye_view import Pixel, Points
from vergence_metric.tracking.known_corners import KnownCorners
from vergence_metric.tracking.locking_tracker import is_inside
from vergence_metric.tracking.modelled_tracker import Fix, ModelledTracker
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.requested_target import USUAL_EXTENT_PX
from vergence_metric.tracking.saccade_detector import EyeMotion
from vergence_metric.tracking.segmentation import Region, Segmenter, layer_tolerance_px
from vergence_metric.tracking.tracked_target import disparity_of_parallax, parallax
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics

_WINDOW_PX = 128  # the foveal window's side
_MOST = 60
_APART_PX = 5.0
_ALIKE = 0.8  # least correlation of the same corner in successive images
_ALIKE_RIGHT = 0.7  # in the other eye, whose view differs more
_LEAST_GATE_PX, _SIGMAS = 2.5, 3.0
_SIGMA_PX = 0.5
_COMMON_REACH_PX = 10  # by which all corners together may be off their prediction
_TURNED_SHARE = 0.3  # of the way that the eyes have turned
_LEAST, _LEAST_AGAIN, _SHARE_AGAIN = 2, 5, 0.4  # corners that locate a target; one that was hidden or jumps
_JUMP_PX = 4.0
_UNBOUNDED_PX = 2.0 * USUAL_EXTENT_PX[0], 2.0 * USUAL_EXTENT_PX[1]  # of a target that has no bounds
_MARGIN = 0.55  # of the extent, from its middle, in which corners belong
_SURE = 12  # corners that give full confidence
_LEAST_PARALLAX_RAD = 0.02


@dataclass(frozen=True)
class _Matched:
    """Corners `known` (M,) that are seen at `px` (M, 2) with what they look like, off by `common_px` together."""

    known: NDArray[np.intp]
    px: Points
    patches: Patches
    common_px: float
    found: Points


@dataclass(frozen=True)
class _Right:
    """What the right eye says: disparity, vertical one, standard deviation [px], or why there is none."""

    across_px: float = math.nan
    down_px: float = math.nan
    sigma_px: float = math.nan
    reason: str = ""


class CornerCluster:
    """The corners of one target, their structure, and where its fixed point is."""

    def __init__(
        self,
        pair: StoredPair,
        point: Pixel,
        region: Region,
        tolerance_px: float,
        estimator: DisparityEstimator,
        parameters: TrackerParameters,
    ) -> None:
        """Learn the corners about a point of the left image that lie in its region and share its disparity.

        They may differ by `tolerance_px`. Where the disparity is not known all corners in the region belong.
        """
        self._estimator, self._parameters, self._tolerance_px = estimator, parameters, tolerance_px
        self._stamp_s, self._views = pair.stamp_s, pair.views
        self._aside_px = np.subtract(region.center_px, point)
        self._extent_px = np.array(region.extent_px or _UNBOUNDED_PX)
        disparity = region.disparity
        self._known_depth = math.isfinite(disparity.horizontal_px)
        across, down = (disparity.horizontal_px, disparity.vertical_px) if self._known_depth else (0.0, 0.0)
        right_px = (point[0] - across, point[1] - down)
        self._parallax_rad = parallax(point, pair.views, right_px) if self._known_depth else math.nan
        relief = max(self._parallax_rad, _LEAST_PARALLAX_RAD) if self._known_depth else 0.0
        self._cameras = (
            AffineCamera(np.eye(2, 3), np.array(point)),
            AffineCamera(np.array([[1.0, 0.0, -relief], [0.0, 1.0, 0.0]]), np.array(right_px)),
        )
        sigma_rad = _SIGMA_PX / pair.views[0].camera.fx_px
        self._point = DirectionFilter(pair.views[0].angles(np.array([point])), sigma_rad)
        self.corners = KnownCorners(sigma_rad, 0.5 * float(self._extent_px.max()))
        found = find_corners(pair.left, point, _WINDOW_PX // 2, _MOST, _APART_PX)
        self._add_corners(pair, found, established=True)

    def locate(self, pair: StoredPair, hidden_s: float, motion: EyeMotion) -> Fix | str:
        """Return where the fixed point is in the next pair; see `modelled_tracker.TargetModel`."""
        elapsed_s, left_view, before = pair.stamp_s - self._stamp_s, pair.views[0], self._views[0]
        hidden = hidden_s > elapsed_s + 1e-6
        self._stamp_s, self._views = pair.stamp_s, pair.views
        self._point.predict(elapsed_s, coasting=hidden)
        self.corners.filters.predict(elapsed_s)
        expected = left_view.pixels(self._point.angles)[0]
        if not is_inside((expected[0], expected[1]), pair.left):
            return "it is predicted outside the left image"
        turned_px = float(np.hypot(*(expected - before.pixels(self._point.angles)[0])))
        matched = self._match(pair, expected, self._reach_px(turned_px, hidden, hidden_s, motion), hidden)
        if matched is None:
            return "there are no corners where it is predicted"
        agree = self._fit(matched, hidden)
        if isinstance(agree, str):
            return agree
        right = self._right_eye(pair, matched.known[agree], matched.px[agree])
        if isinstance(right, str):
            return right
        return self._located(pair, matched, agree, right, hidden)

    def _reach_px(self, turned_px: float, hidden: bool, hidden_s: float, motion: EyeMotion) -> float:
        """Return how far all corners together may be from where they are predicted."""
        p, reach_px = self._parameters, _COMMON_REACH_PX + _TURNED_SHARE * turned_px
        if hidden or motion.jumped:
            reach_px = max(reach_px, p.search_px + p.search_growth_px_s * hidden_s)
        return float(min(reach_px, p.request_search_max_px))

    def _match(self, pair: StoredPair, expected: Points, reach_px: float, hidden: bool) -> _Matched | None:
        """Return which known corners are seen, and where in the left image."""
        corners = self.corners
        half_px = round(_WINDOW_PX / 2 + reach_px)
        found = find_corners(pair.left, (expected[0], expected[1]), half_px, 2 * _MOST, _APART_PX - 2.0)
        if not len(found) or not len(corners):
            return None
        patches = patches_at(pair.left, found)
        shown = self._cameras[0].project(corners.structure.points) - self._cameras[0].origin_px + expected
        followed = (corners.misses == 0) & (not hidden)
        shown[followed] = pair.views[0].pixels(corners.filters.angles[followed])
        alike = corners.patches @ patches.T
        offsets = found[None, :, :] - shown[:, None, :]
        established = corners.established
        common = common_motion(offsets[established][alike[established] >= _ALIKE], reach_px)
        away = np.linalg.norm(offsets - common, axis=2)
        sigmas_px = _SIGMAS * corners.filters.sigma_rad * pair.views[0].camera.fx_px
        gates = np.where(followed, np.clip(sigmas_px, _LEAST_GATE_PX, reach_px), 2.0 * _LEAST_GATE_PX)
        away[(alike < _ALIKE) | (away > gates[:, None])] = np.inf
        nearest = away.argmin(axis=1)
        # Of two that take the same corner the nearer one has it.
        mine = np.isfinite(away.min(axis=1)) & (away.argmin(axis=0)[nearest] == np.arange(len(corners)))
        known = np.flatnonzero(mine)
        chosen = nearest[known]
        return _Matched(known, found[chosen], patches[chosen], float(np.hypot(*common)), found)

    def _fit(self, matched: _Matched, hidden: bool) -> NDArray[np.bool_] | str:
        """Fit the left camera; return which of the matched corners agree with it (M,), or why they do not suffice."""
        corners, camera, before = self.corners, self._cameras[0], self._cameras[0].copy()
        established = corners.established
        counting, total = established[matched.known], int(established.sum())
        structure = corners.structure.points[matched.known]
        depths = corners.structure.depth_variance[matched.known]
        # What is found elsewhere than expected may be another thing, of which a part looks like a part of the target.
        again = hidden or matched.common_px > _JUMP_PX
        needed = max(min(_LEAST_AGAIN, total), _SHARE_AGAIN * min(total, _MOST)) if again else _LEAST
        agree = counting.copy()
        if counting.sum() >= _LEAST:
            agree[counting] = camera.fit(structure[counting], depths[counting], matched.px[counting])
        if agree.sum() < max(needed, min(_LEAST, total)):
            self._cameras = (before, self._cameras[1])
            return f"{int(agree.sum())} of {total} corners agree"
        agree[~counting] = camera.agrees(structure[~counting], depths[~counting], matched.px[~counting])
        return agree

    def _right_eye(self, pair: StoredPair, known: NDArray[np.intp], seen_px: Points) -> _Right | str:
        """Return what the right eye sees of the corners that agree; why they are another thing's if it shows that."""
        left, right = self._cameras
        place = (float(left.origin_px[0]), float(left.origin_px[1]))
        if not self._known_depth:
            return _Right(reason="its distance was not known when it was learnt")
        expected_px = disparity_of_parallax(self._parallax_rad, place, pair.views)
        if expected_px is None:
            return _Right(reason="it does not see there")
        start = np.array([place[0] - expected_px, right.origin_px[1] + place[1] - self._last_left_y])
        structure = self.corners.structure
        guess = right.project(structure.points[known]) - right.origin_px + start
        there, found = match_right(pair.left, pair.right, seen_px, guess, _ALIKE_RIGHT)
        right.move(start)
        count = 0
        if found.sum() >= min(3, len(known)) and found.any():
            seen = known[found]
            agree = right.fit(structure.points[seen], structure.depth_variance[seen], there[found])
            count = int(agree.sum())
        across, down = (left.origin_px - right.origin_px).tolist()
        jump_px = self._parameters.disparity_jump_px
        if count >= max(2, len(known) / 3) and abs(across - expected_px) <= jump_px:
            structure.observe(seen[agree], right, there[found][agree])
            self._update_parallax(pair, place, across, down)
            return _Right(across, down, math.hypot(left.sigma_px, right.sigma_px))
        right.move(start)
        again = self._estimator.estimate(pair.left, pair.right, place, expected_px)
        if not again.ok:
            return _Right(reason=again.reason)
        if abs(again.horizontal_px - expected_px) > jump_px:
            return f"its disparity differs by {again.horizontal_px - expected_px:+.1f} px: occluded"
        self._update_parallax(pair, place, again.horizontal_px, again.vertical_px)
        return _Right(again.horizontal_px, again.vertical_px, again.sigma_px)

    def _update_parallax(self, pair: StoredPair, place: Pixel, across: float, down: float) -> None:
        self._parallax_rad = parallax(place, pair.views, (place[0] - across, place[1] - down))

    def _located(
        self, pair: StoredPair, matched: _Matched, agree: NDArray[np.bool_], right: _Right, hidden: bool
    ) -> Fix:
        """Update the cluster by the corners that are seen, and return where its fixed point is."""
        corners, left_view, origin = self.corners, pair.views[0], self._cameras[0].origin_px
        if hidden:
            self._point.restart(np.array([0]), left_view.angles(origin[None]), np.zeros(2))
        else:
            self._point.update(np.array([0]), left_view.angles(origin[None]))
        self._last_left_y = float(origin[1])
        angles = left_view.angles(matched.px)
        again = corners.misses[matched.known] > 0
        corners.filters.update(matched.known, angles)
        corners.filters.restart(matched.known[again], angles[again], self._point.rates[0])
        corners.update(matched.known, matched.px, matched.patches, agree)
        corners.structure.observe(matched.known[agree], self._cameras[0], matched.px[agree])
        corners.forget()
        visible = int(corners.visible.sum())
        if not right.reason and visible < _MOST:
            self._add_corners(pair, matched.found, established=False)
        confidence = min(visible / min(_SURE, max(len(corners), 1)), 1.0)
        place = (float(origin[0]), float(origin[1]))
        width, height = (self._cameras[0].scale * self._extent_px).tolist()
        return Fix(place, right.across_px, right.down_px, right.sigma_px, (width, height), confidence, right.reason)

    def _add_corners(self, pair: StoredPair, found: Points, established: bool) -> None:
        """Add the corners (N, 2) of the left image that belong to the target and are new."""
        left, right = self._cameras
        self._last_left_y = float(left.origin_px[1])
        room = _MOST - int(self.corners.visible.sum())
        center = left.origin_px + left.scale * self._aside_px
        new = (np.abs(found - center) <= _MARGIN * left.scale * self._extent_px).all(axis=1)
        if len(self.corners):
            shown = left.project(self.corners.structure.points)
            near = np.concatenate([self.corners.px[self.corners.misses == 0], shown])
            new &= np.linalg.norm(found[:, None] - near[None], axis=2).min(axis=1) >= _APART_PX
        found = found[new][:room]
        if not len(found):
            return
        there = found
        if self._known_depth:
            shift = left.origin_px - right.origin_px
            there, matched = match_right(pair.left, pair.right, found, found - shift, _ALIKE_RIGHT)
            member = matched & (np.abs(found - there - shift) <= (self._tolerance_px + 0.75, 2.0)).all(axis=1)
            found, there = found[member], there[member]
        angles = pair.views[0].angles(found)
        which = self.corners.append(
            found, patches_at(pair.left, found), angles, self._point.rates[0], established=established
        )
        self.corners.structure.observe(which, left, found)
        if self._known_depth:
            self.corners.structure.observe(which, right, there)


def learn_corner_cluster(
    pair: StoredPair,
    point: Pixel,
    extent_px: tuple[float, float] | None,
    *,
    estimator: DisparityEstimator,
    parameters: TrackerParameters,
    baseline_m: float,
) -> CornerCluster | str:
    """Return the cluster of corners at a point of a pair, or why there is none; see `modelled_tracker.Learn`."""
    disparity = estimator.estimate(pair.left, pair.right, point)
    region = Segmenter(parameters, estimator, baseline_m).segment(pair.left, pair.right, point, disparity, pair.views)
    if extent_px is not None:
        region = region._replace(center_px=point, extent_px=extent_px)
    # The fixed point is the point itself, whatever the middle of its region is.
    region = region._replace(disparity=disparity)
    across = disparity.horizontal_px
    tolerance_px = layer_tolerance_px(across, pair.views, baseline_m) if math.isfinite(across) else 0.0
    cluster = CornerCluster(pair, point, region, tolerance_px, estimator, parameters)
    return cluster if len(cluster.corners) >= _LEAST else "it has no corners"


def corner_cluster_tracker(
    parameters: TrackerParameters, estimator: DisparityEstimator, camera: CameraModel, kinematics: Kinematics
) -> ModelledTracker:
    """Return the tracker `corner_cluster`; see `protocol.Tracker`."""
    learn = partial(learn_corner_cluster, estimator=estimator, parameters=parameters, baseline_m=kinematics.baseline_m)
    return ModelledTracker(learn, parameters, camera, kinematics)
