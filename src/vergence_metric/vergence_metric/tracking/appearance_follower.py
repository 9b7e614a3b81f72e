"""Follows what the left eye fixates from pair to pair by its appearance, without a detector: `remembered_patch`.

When the eyes come to rest after a saccade, the tracker locks on the object at the left fovea: its region is what shares
the fovea's disparity (zero-disparity filter), and its appearance is learnt. From then on sparse optical flow and
templates follow it in the left image, and the disparity is measured at the point that was fixated, because a solid
object near the head has other disparities elsewhere. Appearance and disparity must both continue as predicted: an
occluder has another disparity and is not followed. The hidden target is then searched around its predicted direction
until it is found again.

A request names the point to follow instead: it is learnt in the image in which it was seen, before the eyes moved, and
found again by that (`remembered_patch.py`), whatever lies at the fovea. Until the next request nothing else is tracked.
"""

from dataclasses import replace

import numpy as np

from vergence_metric.disparity.protocol import Disparity, DisparityEstimator, DisparityStatus, Image
from vergence_metric.tracking.eye_view import EyeView, distance, is_inside
from vergence_metric.tracking.locking_tracker import LockingTracker, fovea_of
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_metric.tracking.requested_target import (
    USUAL_EXTENT_PX,
    find_by_surroundings,
    requested_target,
    track_requested,
    without_drift,
)
from vergence_metric.tracking.saccade_detector import EyeMotion
from vergence_metric.tracking.segmentation import Segmenter, is_plausible, offset_inside
from vergence_metric.tracking.sighted import in_both_eyes, in_left_eye
from vergence_metric.tracking.target_appearance import Sighting, TargetAppearance
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_metric.tracking.tracked_target import Target
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics

_UNMISTAKABLE_SIMILARITY = 0.8


class AppearanceFollower:
    """Follows a target by its appearance; see `follower.Follower`."""

    def __init__(self, parameters: TrackerParameters, estimator: DisparityEstimator, baseline_m: float) -> None:
        self._parameters, self._estimator = parameters, estimator
        self._segmenter = Segmenter(parameters, estimator, baseline_m)

    def requested(self, track_id: int, request: TrackRequest, pair: StoredPair) -> Target:
        """Return the target of a request."""
        return requested_target(track_id, request, pair, self._estimator, self._parameters)

    def locked(self, track_id: int, pair: StoredPair) -> tuple[Target, Track] | str:
        """Return the target at the left fovea with its track, or why there is none."""
        left, right, stamp_s, views = pair.left, pair.right, pair.stamp_s, pair.views
        fovea = fovea_of(left)
        disparity = self._estimator.estimate(left, right, fovea)
        if disparity.status is DisparityStatus.NO_TEXTURE:
            return "no texture at the fovea to lock on"
        point, extent, disparity = self._segmenter.segment(left, right, fovea, disparity, views)
        appearance = TargetAppearance(left, point, extent or USUAL_EXTENT_PX)
        direction = views[0].direction(point)
        target = Target(track_id, stamp_s, appearance, stamp_s, views, direction, np.zeros(3), extent is not None)
        target.aside_px = offset_inside(fovea, point, extent)
        return target, self._visible(target, Sighting(point, 1.0, 0), disparity, pair)

    def follow(self, target: Target, pair: StoredPair, motion: EyeMotion) -> Track | str:
        """Return the track of a target in the next pair, or why it is given up."""
        p = self._parameters
        left, right, stamp_s, views = pair.left, pair.right, pair.stamp_s, pair.views
        target.turn_to(views)
        hidden_s = stamp_s - target.seen_s if target.hidden else 0.0
        if hidden_s > p.give_up_s and target.patch is None:
            return f"target lost: not found for {hidden_s:.1f} s"
        sighting = self._find(target, left, stamp_s, views)
        if sighting is None:
            target.hidden = True
            return _hidden(target, f"target predicted outside the left image, hidden for {hidden_s:.1f} s")
        if target.hidden:
            needed = p.reacquire_similarity if target.found else p.request_similarity
        else:
            needed = p.min_similarity
        if sighting.similarity < needed or not is_inside(sighting.pixel, left):
            target.hidden = True
            return _hidden(target, f"target hidden for {hidden_s:.1f} s, best similarity {sighting.similarity:.2f}")
        if target.depths is not None:
            if motion.saccading:
                # The servos are not where they report: what the eyes pass is no evidence of where the target is.
                return in_left_eye(target, sighting, "the eyes are in a saccade")
            return track_requested(target, target.depths, sighting, pair, self._estimator, p.place_spread_px)
        fixated = target.fixated_px(sighting.pixel)
        if not is_inside(fixated, left):
            fixated = sighting.pixel
        expected_px = target.expected_disparity(fixated, views)
        disparity = self._estimator.estimate(left, right, fixated, expected_px)
        if not disparity.ok and fixated != sighting.pixel:
            disparity = self._estimator.estimate(left, right, sighting.pixel, expected_px)
        if disparity.ok and expected_px is not None and target.disparity_age_s(stamp_s) < 0.5:
            jump = disparity.horizontal_px - expected_px
            # Servos without feedback are off their reported angles while they move: unchanged appearance counts more.
            if abs(jump) > p.disparity_jump_px and sighting.similarity < _UNMISTAKABLE_SIMILARITY:
                target.hidden = True
                return _hidden(target, f"disparity at the target's position differs by {jump:+.1f} px: occluded")
        if disparity.ok and not target.bounded and target.segmentation_due():
            point, extent, disparity = self._segmenter.segment(left, right, sighting.pixel, disparity, views)
            if extent is not None:
                # It had no bounds when it was locked: the right eye did not see it yet, or the eyes stood otherwise.
                target.aside_px, target.bounded = offset_inside(sighting.pixel, point, extent), True
                sighting = replace(sighting, pixel=point)
                target.appearance = TargetAppearance(left, point, extent)
                target.update_direction(stamp_s, views[0].direction(point))
                return self._visible(target, sighting, disparity, pair)
        target.appearance.accept(left, sighting, renew=disparity.ok)
        target.update_direction(stamp_s, views[0].direction(sighting.pixel))
        return self._visible(target, sighting, disparity, pair)

    def _find(self, target: Target, left: Image, stamp_s: float, views: tuple[EyeView, EyeView]) -> Sighting | None:
        """Return the best sighting in the left image; None if it is predicted outside."""
        p = self._parameters
        if target.patch is not None:
            sighting = find_by_surroundings(target, target.patch, left, stamp_s, views[0], p)
            if sighting is not None or not target.found:
                return sighting
        expected = views[0].pixel(target.predicted(stamp_s))
        # A hidden target has moved on as predicted, or stayed where it was last seen.
        candidates = [expected, views[0].pixel(target.direction)] if target.hidden else [expected]
        candidates = [pixel for pixel in candidates if is_inside(pixel, left)]
        if not candidates:
            return None
        if not target.hidden:
            followed = target.appearance.follow(left, expected)
            if target.patch is None:
                return followed
            return without_drift(target, target.patch, followed, left, views[0], p)
        reach = round(p.search_px + p.search_growth_px_s * (stamp_s - target.seen_s))
        if distance(candidates[0], candidates[-1]) < reach:
            candidates = candidates[:1]
        sightings = [target.appearance.search(left, pixel, reach) for pixel in candidates]
        return max(sightings, key=lambda one: one.similarity)

    def _visible(self, target: Target, sighting: Sighting, disparity: Disparity, pair: StoredPair) -> Track:
        """Return the track of a target that was found in the left eye."""
        expected_px = target.expected_disparity(target.fixated_px(sighting.pixel), pair.views)
        track = in_left_eye(target, sighting, disparity.reason)
        if not is_plausible(disparity, expected_px, self._parameters.disparity_jump_px):
            return track
        return in_both_eyes(track, target, disparity, pair.views, pair.stamp_s)


def _hidden(target: Target, reason: str) -> Track:
    nowhere = Track.nowhere(target.track_id, TrackStatus.LOST, reason, target.lock_stamp_s)
    return replace(nowhere, goal_id=target.goal_id)


def remembered_patch_tracker(
    parameters: TrackerParameters, estimator: DisparityEstimator, camera: CameraModel, kinematics: Kinematics
) -> LockingTracker:
    """Return the tracker `remembered_patch`; see `protocol.Tracker`."""
    follower = AppearanceFollower(parameters, estimator, kinematics.baseline_m)
    return LockingTracker(follower, parameters, camera, kinematics)
