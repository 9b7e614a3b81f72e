"""A target as a cluster of corners: each is followed by itself, and a fixed point is transferred by their structure.

After Reid and Murray, "Active tracking of foveated feature clusters using affine structure" (1996). In every pair
corners are found in the foveal window about the predicted point and matched with the known ones. The fixed point is
where the affine camera of those that agree puts it, in each eye. Corners that are not seen stay known, so that a target
that was covered bit by bit is found again.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import Disparity, DisparityEstimator
from vergence_metric.tracking.affine_transfer import AffineCamera
from vergence_metric.tracking.corner_association import MatchedCorners, match_corners
from vergence_metric.tracking.corners import find_corners, match_right, patches_at, strongest_corner
from vergence_metric.tracking.direction_filter import DirectionFilter
from vergence_metric.tracking.eye_view import Pixel, Points, is_inside
from vergence_metric.tracking.known_corners import KnownCorners
from vergence_metric.tracking.modelled_follower import Fix
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.requested_target import USUAL_EXTENT_PX
from vergence_metric.tracking.saccade_detector import EyeMotion
from vergence_metric.tracking.segmentation import Region
from vergence_metric.tracking.target_depth import TargetDepth

_WINDOW_PX = 128  # the foveal window's side, at most
_MOST, _MOST_FOUND = 60, 120  # corners of a target, and in a window of its size
_APART_PX = 5.0
_ALIKE_RIGHT = 0.7  # least correlation of a corner in the other eye, whose view differs more
_SIGMA_PX = 0.5
_COMMON_REACH_PX = 10  # by which all corners together may be off their prediction
_TURNED_SHARE = 0.3  # of the way that the eyes have turned
_LEAST, _LEAST_AGAIN, _SHARE_AGAIN = 2, 5, 0.4  # corners that locate a target; one that was hidden or jumps
_JUMP_PX = 4.0
_UNBOUNDED_PX = 2.0 * USUAL_EXTENT_PX[0], 2.0 * USUAL_EXTENT_PX[1]  # of a target that has no bounds
_LEAST_EXTENT_PX = (40.0, 40.0)
_MARGIN = 0.55  # of the extent, from its middle, in which corners belong
_SURE = 12  # corners that give full confidence
_RELOCKED = 0.5  # confidence while no corner confirms the place
_IN_SACCADE = "the eyes are in a saccade"
_LEAST_PARALLAX_RAD = 0.02


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
        disparity: Disparity,
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
        self._extent_px = np.maximum(region.extent_px or _UNBOUNDED_PX, _LEAST_EXTENT_PX)
        self._depth = TargetDepth(disparity, pair, point, parameters)
        across, down = (disparity.horizontal_px, disparity.vertical_px) if self._depth.known else (0.0, 0.0)
        relief = max(self._depth.parallax_rad, _LEAST_PARALLAX_RAD) if self._depth.known else _LEAST_PARALLAX_RAD
        self._down_px = down  # how much higher the fixed point is seen in the right eye
        right_px = np.array([point[0] - across, point[1] - down])
        self._cameras = (
            AffineCamera(np.eye(2, 3), np.array(point)),
            AffineCamera(np.array([[1.0, 0.0, -relief], [0.0, 1.0, 0.0]]), right_px),
        )
        self._sigma_rad = _SIGMA_PX / pair.views[0].camera.fx_px
        self._eye_sigma_rad = 0.0  # of the reported angles of the left eye in the last pair
        self._point = DirectionFilter(pair.views[0].angles(np.array([point])), self._sigma_rad)
        self.corners = self._no_corners()
        found = find_corners(pair.left, point, self._half_px, _MOST, _APART_PX)
        self._strongest = strongest_corner(pair.left, point, self._half_px)
        # The depth of the surface about the point, by how its disparity changes over the image; or it faces the eyes.
        slopes = np.zeros(2) if disparity.surface is None else disparity.surface.slopes[0] / relief
        self._plane = max((np.zeros(2), slopes), key=lambda plane: len(self._members(pair, found, plane)[0]))
        self._add_corners(pair, found, established=True)

    @property
    def _half_px(self) -> int:
        """Half the side of the window in which the target's corners are."""
        reach_px = self._cameras[0].scale * (_MARGIN * self._extent_px + np.abs(self._aside_px)).max()
        return round(min(float(reach_px), _WINDOW_PX / 2))

    def locate(self, pair: StoredPair, hidden_s: float, motion: EyeMotion) -> Fix | str:
        """Return where the fixed point is in the next pair; see `modelled_follower.TargetModel`."""
        elapsed_s, left_view, before = pair.stamp_s - self._stamp_s, pair.views[0], self._views
        hidden = hidden_s > elapsed_s + 1e-6
        self._stamp_s, self._views = pair.stamp_s, pair.views
        self._point.predict(elapsed_s, coasting=hidden)
        self.corners.filters.predict(elapsed_s)
        expected = left_view.pixels(self._point.angles)[0]
        if not is_inside((expected[0], expected[1]), pair.left):
            return "it is predicted outside the left image"
        turned_px = float(np.hypot(*(expected - before[0].pixels(self._point.angles)[0])))
        for camera, then, now in zip(self._cameras, before, pair.views, strict=True):
            camera.turn(now.stretch(then, camera.origin_px))
        reach_px = self._reach_px(turned_px, hidden, hidden_s, motion)
        self._eye_sigma_rad = _TURNED_SHARE * turned_px / left_view.camera.fx_px
        window_px = round(self._half_px + reach_px)
        # What is around the target has corners too, and the more the farther it is searched.
        most = min(round(_MOST_FOUND * (window_px / self._half_px) ** 2), 3 * _MOST_FOUND)
        found = find_corners(pair.left, (expected[0], expected[1]), window_px, most, _APART_PX - 2.0, self._strongest)
        if not len(found):
            return "there are no corners where it is predicted"
        matched = match_corners(pair.left, left_view, found, self.corners, self._cameras[0], expected, reach_px, hidden)
        agree = self._fit(matched, hidden)
        if isinstance(agree, str):
            return agree
        origin = self._cameras[0].origin_px
        if not is_inside((origin[0], origin[1]), pair.left):
            return "its corners put it outside the left image"
        if motion.saccading:
            # The servos are not where they report: what the right eye sees says nothing of the distance.
            right: _Right | str = _Right(reason=_IN_SACCADE)
        else:
            right = self._right_eye(pair, matched, agree)
        if isinstance(right, str):
            return right
        return self._located(pair, matched, agree, right, hidden)

    def relock(self, pair: StoredPair, place: Pixel, motion: EyeMotion) -> Fix:
        """Learn the corners anew where the fixed point is known to be in the pair that was located last.

        While its distance is not known in that pair, the corners that are known are kept.
        """
        self._cameras[0].move(np.array(place))
        self._point.restart(np.array([0]), pair.views[0].angles(np.array([place])), np.zeros(2))
        if motion.saccading:
            return self._fix(pair, _Right(reason=_IN_SACCADE), _RELOCKED)
        seen = self._depth.weigh(pair, place, self._estimator)
        if isinstance(seen, str):
            return self._fix(pair, _Right(reason=seen), _RELOCKED)
        measured = self._measured(pair, place, seen.horizontal_px, seen.vertical_px, seen.sigma_px)
        known, self.corners = self.corners, self._no_corners()
        found = find_corners(pair.left, place, self._half_px, _MOST, _APART_PX)
        self._add_corners(pair, found, established=True)
        if len(self.corners) < _LEAST_AGAIN:
            self.corners = known
        return self._fix(pair, measured, _RELOCKED)

    def _no_corners(self) -> KnownCorners:
        return KnownCorners(self._sigma_rad, 0.5 * float(self._extent_px.max()))

    def _reach_px(self, turned_px: float, hidden: bool, hidden_s: float, motion: EyeMotion) -> float:
        """Return how far all corners together may be from where they are predicted."""
        p, reach_px = self._parameters, _COMMON_REACH_PX + _TURNED_SHARE * turned_px
        if hidden or motion.jumped:
            reach_px = max(reach_px, p.search_px + p.search_growth_px_s * hidden_s)
        return float(min(reach_px, p.request_search_max_px))

    def _fit(self, matched: MatchedCorners, hidden: bool) -> NDArray[np.bool_] | str:
        """Fit the left camera; return which of the matched corners agree with it (M,), or why they do not suffice."""
        corners, camera, before = self.corners, self._cameras[0], self._cameras[0].copy()
        established = corners.established
        counting, total = established[matched.known], int(corners.expected.sum())
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

    def _right_eye(self, pair: StoredPair, matched: MatchedCorners, agree: NDArray[np.bool_]) -> _Right | str:
        """Return what the right eye sees of the corners that agree; why they are another thing's if it shows that."""
        known, seen_px, patches = matched.known[agree], matched.px[agree], matched.patches[agree]
        left, right = self._cameras
        place = (float(left.origin_px[0]), float(left.origin_px[1]))
        weighed = None if self._depth.certain else self._depth.weigh(pair, place, self._estimator)
        expected_px = self._depth.expected_px(place, pair.views)
        if expected_px is None:
            return _Right(reason="it does not see there" if self._depth.known else "its distance is not known")
        start = np.array([place[0] - expected_px, place[1] - self._down_px])
        structure = self.corners.structure
        guess = right.project(structure.points[known]) - right.origin_px + start
        there, found = match_right(pair.left, pair.right, seen_px, guess, _ALIKE_RIGHT, patches)
        right.move(start)
        count = 0
        if found.sum() >= min(3, len(known)) and found.any():
            seen = known[found]
            fits = right.fit(structure.points[seen], structure.depth_variance[seen], there[found])
            count = int(fits.sum())
        across, down = (left.origin_px - right.origin_px).tolist()
        jump_px = self._parameters.disparity_jump_px
        if count >= max(2, len(known) / 3) and abs(across - expected_px) <= jump_px:
            structure.observe(seen[fits], right, there[found][fits])
            return self._measured(pair, place, across, down, math.hypot(left.sigma_px, right.sigma_px))
        right.move(start)
        # A search about the expected disparity adds nothing to one over the whole range.
        again = weighed or self._estimator.estimate(pair.left, pair.right, place, expected_px)
        if isinstance(again, str):
            return _Right(reason=again)
        if not again.ok:
            return _Right(reason=again.reason)
        few = len(known) < _SHARE_AGAIN * min(int(self.corners.established.sum()), _MOST)
        # Joints of hobby servos shift what is expected; what covers a target shows hardly any of its corners.
        if few and abs(again.horizontal_px - expected_px) > jump_px:
            return f"its disparity differs by {again.horizontal_px - expected_px:+.1f} px: occluded"
        return self._measured(pair, place, again.horizontal_px, again.vertical_px, again.sigma_px)

    def _measured(self, pair: StoredPair, place: Pixel, across_px: float, down_px: float, sigma_px: float) -> _Right:
        """Use the disparities of the fixed point at a place of the left image as the target's."""
        self._depth.measured(pair, place, across_px, down_px)
        self._down_px = down_px
        self._cameras[1].move(np.array([place[0] - across_px, place[1] - down_px]))
        return _Right(across_px, down_px, sigma_px)

    def _located(
        self, pair: StoredPair, matched: MatchedCorners, agree: NDArray[np.bool_], right: _Right, hidden: bool
    ) -> Fix:
        """Update the cluster by the corners that are seen, and return where its fixed point is."""
        corners, left_view, origin = self.corners, pair.views[0], self._cameras[0].origin_px
        if hidden:
            self._point.restart(np.array([0]), left_view.angles(origin[None]), np.zeros(2))
        else:
            self._point.update(np.array([0]), left_view.angles(origin[None]), self._eye_sigma_rad)
        angles = left_view.angles(matched.px)
        again = corners.misses[matched.known] > 0
        corners.filters.update(matched.known, angles, self._eye_sigma_rad)
        corners.filters.restart(matched.known[again], angles[again], self._point.rates[0])
        corners.update(matched.known, matched.px, matched.patches, agree)
        corners.structure.observe(matched.known[agree], self._cameras[0], matched.px[agree])
        corners.forget()
        visible = int(corners.visible.sum())
        if not right.reason and visible < _MOST:
            self._add_corners(pair, matched.found, established=False)
        return self._fix(pair, right, min(visible / min(_SURE, max(len(corners), 1)), 1.0))

    def _fix(self, pair: StoredPair, right: _Right, confidence: float) -> Fix:
        """Return where the fixed point is, by the cameras and what the right eye says."""
        origin = self._cameras[0].origin_px
        place = (float(origin[0]), float(origin[1]))
        width, height = (self._cameras[0].scale * self._extent_px).tolist()
        candidates = self._depth.candidates(place, pair.views)
        reason = self._depth.doubt if candidates else right.reason
        disparities = right.across_px, right.down_px, right.sigma_px
        return Fix(place, *disparities, (width, height), confidence, reason, candidates)

    def _add_corners(self, pair: StoredPair, found: Points, established: bool) -> None:
        """Add the corners (N, 2) of the left image that belong to the target and are new."""
        left, right = self._cameras
        room = _MOST - int(self.corners.visible.sum())
        center = left.origin_px + left.scale * self._aside_px
        found = found[(np.abs(found - center) <= _MARGIN * left.scale * self._extent_px).all(axis=1)]
        if len(self.corners):
            shown = left.project(self.corners.structure.points)
            near = np.concatenate([self.corners.px[self.corners.misses == 0], shown])
            away = np.hypot(*(found[:, axis, None] - near[:, axis] for axis in (0, 1)))
            found = found[away.min(axis=1) >= _APART_PX]
        found, there = self._members(pair, found[:room], self._plane)
        if not len(found):
            return
        angles, rates = pair.views[0].angles(found), self._point.rates[0]
        which = self.corners.append(found, patches_at(pair.left, found), angles, rates, established)
        self.corners.structure.observe(which, left, found)
        if self._depth.known:
            self.corners.structure.observe(which, right, there)

    def _members(self, pair: StoredPair, found: Points, plane: Points) -> tuple[Points, Points]:
        """Return which corners (N, 2) of the left image share the disparity of the surface, and where in the right one.

        `plane` (2,) is how the structure's third coordinate changes over its first two. Where the distance is not known
        all belong.
        """
        if not self._depth.known or not len(found):
            return found, found
        expected = self._cameras[1].project(self._on_plane(found, plane))
        there, matched = match_right(pair.left, pair.right, found, expected, _ALIKE_RIGHT)
        member = matched & (np.abs(there - expected) <= (self._tolerance_px + 0.75, 2.0)).all(axis=1)
        return found[member], there[member]

    def _on_plane(self, px: Points, plane: Points) -> Points:
        """Return the structure (N, 3) of pixels (N, 2) of the left image that lie on a plane through the origin."""
        left = self._cameras[0]
        flat = left.matrix[:, :2] + np.outer(left.matrix[:, 2], plane)
        across = (px - left.origin_px) @ np.linalg.inv(flat).T
        return np.column_stack([across, across @ plane])
