"""The class-free tracker: follows what the left eye fixates from pair to pair, without a detector.

When the eyes come to rest after a saccade, the tracker locks on the object at the left fovea: its region is what shares
the fovea's disparity (zero-disparity filter), and its appearance is learnt. From then on sparse optical flow and
templates follow it in the left image, and the disparity is measured at the point that was fixated, because a solid
object near the head has other disparities elsewhere. Appearance and disparity must both continue as predicted: an
occluder has another disparity and is not followed. The hidden target is then searched around its predicted direction
until it is found again.

A request names the point to follow instead: it is learnt in the image in which it was seen, before the eyes moved, and
found again by that (`remembered_patch.py`), whatever lies at the fovea. Until the next request nothing else is tracked.
"""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from vergence_metric.disparity.protocol import Disparity, DisparityEstimator, DisparityStatus, Image
from vergence_metric.pairs.frame_motion import frame_motion_px
from vergence_metric.tracking.eye_view import EyeView, Pixel, distance
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_metric.tracking.requested_target import (
    USUAL_EXTENT_PX,
    find_by_surroundings,
    requested_target,
    track_requested,
    without_drift,
)
from vergence_metric.tracking.saccade_detector import EyeMotion, SaccadeDetector, StampedEyeAngles
from vergence_metric.tracking.segmentation import Segmenter, is_plausible, offset_inside
from vergence_metric.tracking.sighted import in_both_eyes, in_left_eye
from vergence_metric.tracking.target_appearance import Sighting, TargetAppearance
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_metric.tracking.tracked_target import Target
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics

_UNMISTAKABLE_SIMILARITY = 0.8
_KEPT_SHARE = 0.9  # of a saccade: the largest distance from the fovea at which the target was not left


class TargetTracker:
    """Follows one target; `update` must be called with every pair, in order of their stamps."""

    def __init__(
        self,
        parameters: TrackerParameters,
        estimator: DisparityEstimator,
        camera: CameraModel,
        kinematics: Kinematics,
    ) -> None:
        self._parameters = parameters
        self._estimator = estimator
        self._segmenter = Segmenter(parameters, estimator, kinematics.baseline_m)
        self._camera, self._pitch_rad = camera, kinematics.pitch_rad
        self._track_id = 0
        self.reset()

    def reset(self) -> None:
        """Drop the target and the eyes' motion; the next lock has a new id."""
        self._saccades = SaccadeDetector(self._parameters)
        self._target: Target | None = None
        self._wants_lock = True
        self._stamp_s = self._lost_s = -math.inf
        self._before: Image | None = None
        # Recent distances of the target from the fovea, up to the start of the current saccade: (stamp, px).
        self._distances: deque[tuple[float, float]] = deque()

    def request(self, request: TrackRequest, pair: StoredPair) -> None:
        """Follow a point of a stored pair from now on, on behalf of the request's goal."""
        self._track_id += 1
        self._wants_lock = False
        self._target = requested_target(self._track_id, request, pair, self._estimator, self._parameters)

    def lock_here(self) -> None:
        """Lock again on the object at the fovea as soon as the eyes are at rest, as after a saccade."""
        self._target, self._wants_lock = None, True

    def update(
        self, left: Image, right: Image, stamp_s: float, eyes: EyeAngles, samples: Iterable[StampedEyeAngles] = ()
    ) -> Track:
        """Return the track in a pair. The left image is kept until the next call and must not be changed.

        Args:
            left: (h, w) grey image of the left eye.
            right: (h, w) grey image of the right eye, aligned.
            stamp_s: of the left image; one that is not later than the last resets the tracker.
            eyes: joint angles, of the left eye and the tilt at the left stamp, of the right eye at the right stamp.
            samples: joint angles since the pair before, in order of their stamps [s].

        """
        if stamp_s <= self._stamp_s:
            self.reset()
        motion = self._saccades.update(stamp_s, eyes, samples)
        left_view, right_view = (
            EyeView(self._camera, pan_rad, eyes.tilt_rad, self._pitch_rad)
            for pan_rad in (eyes.pan_left_rad, eyes.pan_right_rad)
        )
        views = (left_view, right_view)
        before, self._before, self._stamp_s = self._before, left, stamp_s
        if self._target is not None and self._target.patch is not None:
            return self._follow(self._target, left, right, stamp_s, views, motion.saccading)
        self._wants_lock |= motion.jumped
        if self._target is not None:
            track = self._follow(self._target, left, right, stamp_s, views)
            self._wants_lock &= not self._is_kept(track, left, stamp_s)
            if not self._wants_lock:
                return track
        if not self._wants_lock:
            # Another target may have replaced the lost one, and eyes that are held still make no saccade.
            self._wants_lock = min(motion.rested_s, stamp_s - self._lost_s) >= self._parameters.relock_s
            return self._untracked(TrackStatus.LOST, "target lost: hidden too long; locks again once the eyes rest")
        if motion.saccading:
            return self._untracked(TrackStatus.LOCKING, "not locked yet: an eye is in a saccade")
        if not self._is_at_rest(motion, before, left):
            return self._untracked(TrackStatus.LOCKING, "not locked yet: the eyes have only just come to rest")
        return self._lock(left, right, stamp_s, views)

    def _is_kept(self, track: Track, left: Image, stamp_s: float) -> bool:
        """Return whether the eyes turned towards the target, or with it, rather than away to something else."""
        if track.status not in (TrackStatus.OK, TrackStatus.OCCLUDED):
            return False
        p = self._parameters
        away_px = distance(track.left_px, _fovea(left))
        saccade_px = self._camera.fx_px * math.tan(p.saccade_rad)
        if not self._wants_lock:
            self._distances.append((stamp_s, away_px))
            while self._distances[0][0] < stamp_s - p.saccade_s:
                self._distances.popleft()
        before_px = self._distances[0][1] if self._distances else 0.0
        # Eyes that jumped in depth turned to something else on the same ray.
        if not abs(track.disparity_px) < _KEPT_SHARE * saccade_px:
            return False
        return away_px < max(_KEPT_SHARE * saccade_px, before_px + 0.5 * saccade_px)

    def _is_at_rest(self, motion: EyeMotion, before: Image | None, left: Image) -> bool:
        """Return whether the left eye rests: its joints, and its image unless that has moved for too long already."""
        p = self._parameters
        if motion.rested_s < p.settle_s or before is None or before.shape != left.shape:
            return False
        return motion.rested_s >= p.still_wait_s or frame_motion_px(before, left) <= p.still_px

    def _untracked(self, status: TrackStatus, reason: str) -> Track:
        return Track.nowhere(self._track_id, status, reason)

    def _lock(self, left: Image, right: Image, stamp_s: float, views: tuple[EyeView, EyeView]) -> Track:
        """Lock on the object at the fovea."""
        self._target, fovea = None, _fovea(left)
        disparity = self._estimator.estimate(left, right, fovea)
        if disparity.status is DisparityStatus.NO_TEXTURE:
            return self._untracked(TrackStatus.UNLOCKED, "no texture at the fovea to lock on")
        point, extent, disparity = self._segmenter.segment(left, right, fovea, disparity, views)
        self._track_id += 1
        self._wants_lock = False
        self._distances.clear()
        appearance = TargetAppearance(left, point, extent or USUAL_EXTENT_PX)
        direction = views[0].direction(point)
        self._target = Target(self._track_id, stamp_s, appearance, stamp_s, direction, np.zeros(3), extent is not None)
        self._target.aside_px = offset_inside(fovea, point, extent)
        return self._visible(self._target, Sighting(point, 1.0, 0), disparity, views)

    def _follow(
        self,
        target: Target,
        left: Image,
        right: Image,
        stamp_s: float,
        views: tuple[EyeView, EyeView],
        saccading: bool = False,
    ) -> Track:
        """Find the target again in the next pair."""
        p = self._parameters
        hidden_s = stamp_s - target.seen_s if target.hidden else 0.0
        if hidden_s > p.give_up_s and target.patch is None:
            self._target, self._lost_s = None, stamp_s
            return self._untracked(TrackStatus.LOST, f"target lost: not found for {hidden_s:.1f} s")
        sighting = self._find(target, left, stamp_s, views)
        if sighting is None:
            target.hidden = True
            return self._hidden(target, f"target predicted outside the left image, hidden for {hidden_s:.1f} s")
        if target.hidden:
            needed = p.reacquire_similarity if target.found else p.request_similarity
        else:
            needed = p.min_similarity
        if sighting.similarity < needed or not _inside(sighting.pixel, left):
            target.hidden = True
            return self._hidden(
                target, f"target hidden for {hidden_s:.1f} s, best similarity {sighting.similarity:.2f}"
            )
        if target.depths is not None:
            if saccading:
                # The servos are not where they report: what the eyes pass is no evidence of where the target is.
                return in_left_eye(target, sighting, "the eyes are in a saccade")
            pair = StoredPair(stamp_s, left, right, views)
            return track_requested(target, target.depths, sighting, pair, self._estimator, p.place_spread_px)
        fixated = target.fixated_px(sighting.pixel)
        if not _inside(fixated, left):
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
                return self._hidden(target, f"disparity at the target's position differs by {jump:+.1f} px: occluded")
        if disparity.ok and not target.bounded and target.segmentation_due():
            point, extent, disparity = self._segmenter.segment(left, right, sighting.pixel, disparity, views)
            if extent is not None:
                # It had no bounds when it was locked: the right eye did not see it yet, or the eyes stood otherwise.
                target.aside_px, target.bounded = offset_inside(sighting.pixel, point, extent), True
                sighting = replace(sighting, pixel=point)
                target.appearance = TargetAppearance(left, point, extent)
                target.update_direction(stamp_s, views[0].direction(point))
                return self._visible(target, sighting, disparity, views)
        target.appearance.accept(left, sighting, renew=disparity.ok)
        target.update_direction(stamp_s, views[0].direction(sighting.pixel))
        return self._visible(target, sighting, disparity, views)

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
        candidates = [pixel for pixel in candidates if _inside(pixel, left)]
        if not candidates:
            return None
        if not target.hidden:
            followed = target.appearance.follow(left, expected)
            return without_drift(followed, target.patch, left, views[0], p) if target.patch else followed
        reach = round(p.search_px + p.search_growth_px_s * (stamp_s - target.seen_s))
        if distance(candidates[0], candidates[-1]) < reach:
            candidates = candidates[:1]
        sightings = [target.appearance.search(left, pixel, reach) for pixel in candidates]
        return max(sightings, key=lambda one: one.similarity)

    def _hidden(self, target: Target, reason: str) -> Track:
        nowhere = Track.nowhere(self._track_id, TrackStatus.LOST, reason, target.lock_stamp_s)
        return replace(nowhere, goal_id=target.goal_id)

    def _visible(
        self, target: Target, sighting: Sighting, disparity: Disparity, views: tuple[EyeView, EyeView]
    ) -> Track:
        """Return the track of a target that was found in the left eye."""
        expected_px = target.expected_disparity(target.fixated_px(sighting.pixel), views)
        track = in_left_eye(target, sighting, disparity.reason)
        if not is_plausible(disparity, expected_px, self._parameters.disparity_jump_px):
            return track
        return in_both_eyes(track, target, disparity, views, self._stamp_s)


def _fovea(image: Image) -> Pixel:
    return (image.shape[1] - 1) / 2, (image.shape[0] - 1) / 2


def _inside(pixel: Pixel, image: Image) -> bool:
    return bool(0.0 <= pixel[0] <= image.shape[1] - 1 and 0.0 <= pixel[1] <= image.shape[0] - 1)
