"""The class-free tracker: what the left eye came to rest on, followed from pair to pair without a detector.

When the eyes come to rest after a saccade, whatever lies at the left fovea is locked on: its region is what shares the
fovea's disparity (zero-disparity filter), its looks are learnt. From then on sparse flow and templates follow it in the
left image, wherever it goes, and the disparity estimator reads the disparity of the point that was looked at: a solid
thing near the head has others elsewhere. Looks and disparity must both go on as expected: something that passes in
front has another disparity and is not followed; the target is then searched for about the direction it is predicted in
until it shows again.
"""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from vergence_metric.disparity.parameters import TrackerParameters
from vergence_metric.disparity.protocol import Disparity, DisparityEstimator, DisparityStatus, Image
from vergence_metric.pairs.image_motion import image_motion_px
from vergence_metric.tracking.appearance import Appearance, Sighting, distance
from vergence_metric.tracking.saccade_detector import EyeState, EyeView, EyeWatch, Pixel, Told
from vergence_metric.tracking.track import NOWHERE, Track, TrackStatus
from vergence_metric.tracking.tracked_target import Target
from vergence_metric.tracking.zero_disparity import ZeroDisparity, zero_disparity
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles

_USUAL_EXTENT_PX = (60.0, 60.0)
_UNMISTAKABLE_LIKENESS = 0.8
_KEPT_SHARE = 0.9  # of a saccade: nearer to the fovea than this the target was not left
_DISTRUST_WITHOUT_DISPARITY = 0.6
_USUAL_DEPTH_M = 0.06


class TargetTracker:
    """Stateful; give it every pair in order of their stamps."""

    def __init__(
        self,
        parameters: TrackerParameters,
        estimator: DisparityEstimator,
        left_camera: CameraModel,
        right_camera: CameraModel,
        baseline_m: float,
    ) -> None:
        self._parameters = parameters
        self._baseline_m = baseline_m
        self._estimator = estimator
        self._cameras = (left_camera, right_camera)
        self._track_id = 0
        self.reset()

    def reset(self) -> None:
        """Forget the target and the eyes' motion; the next lock has a new id."""
        self._watch = EyeWatch(self._parameters)
        self._target: Target | None = None
        self._wants_lock = True
        self._stamp_s = self._lost_s = -math.inf
        self._before: Image | None = None
        # How far from the fovea the target was seen of late, until the saccade in progress began: (stamp, px).
        self._distances: deque[tuple[float, float]] = deque()

    def lock_here(self) -> None:
        """Lock anew on what lies at the fovea as soon as the eyes rest, as after a saccade."""
        self._target, self._wants_lock = None, True

    def update(
        self, left: Image, right: Image, stamp_s: float, eyes: EyeAngles, on_the_way: Iterable[Told] = ()
    ) -> Track:
        """Take a pair and say where the target is. The left image is kept until the next call: do not write into it.

        Args:
            left: (h, w) grey image of the left eye.
            right: (h, w) grey image of the right eye, aligned.
            stamp_s: of the left image; one that is not later than the last resets the tracker.
            eyes: joint angles, of the left eye and the tilt at the left stamp, of the right eye at the right stamp.
            on_the_way: joint angles that were told since the pair before, in order of their stamps [s].

        """
        if stamp_s <= self._stamp_s:
            self.reset()
        state = self._watch.update(stamp_s, eyes, on_the_way)
        views = (
            EyeView(self._cameras[0], eyes.pan_left_rad, eyes.tilt_rad),
            EyeView(self._cameras[1], eyes.pan_right_rad, eyes.tilt_rad),
        )
        before, self._before, self._stamp_s = self._before, left, stamp_s
        self._wants_lock |= state.jumped
        if self._target is not None:
            track = self._follow(self._target, left, right, stamp_s, views)
            self._wants_lock &= not self._is_kept(track, left, stamp_s)
            if not self._wants_lock:
                return track
        if not self._wants_lock:
            # A new target may have taken its place, and eyes that are held make no saccade to say so.
            self._wants_lock = min(state.rested_s, stamp_s - self._lost_s) >= self._parameters.track_relock_s
            return self._without(TrackStatus.LOST, "the target was hidden too long; locking anew once the eyes rest")
        if state.saccading:
            return self._without(TrackStatus.LOCKING, "the left eye is in a saccade")
        if not self._at_rest(state, before, left):
            return self._without(TrackStatus.LOCKING, "the eyes came to rest just now")
        return self._lock(left, right, stamp_s, views)

    def _is_kept(self, track: Track, left: Image, stamp_s: float) -> bool:
        """Tell whether the eye turned towards the target, or with it, rather than away to something else."""
        if track.status not in (TrackStatus.OK, TrackStatus.OCCLUDED):
            return False
        p = self._parameters
        away_px = distance(track.left_px, _fovea(left))
        saccade_px = self._cameras[0].fx_px * math.tan(math.radians(p.track_saccade_deg))
        if not self._wants_lock:
            self._distances.append((stamp_s, away_px))
            while self._distances[0][0] < stamp_s - p.track_saccade_s:
                self._distances.popleft()
        before_px = self._distances[0][1] if self._distances else 0.0
        # Eyes that jumped in depth turned to something else on the same ray.
        if not abs(track.disparity_px) < _KEPT_SHARE * saccade_px:
            return False
        return away_px < max(_KEPT_SHARE * saccade_px, before_px + 0.5 * saccade_px)

    def _at_rest(self, state: EyeState, before: Image | None, left: Image) -> bool:
        """Tell whether the left eye rests: its joints, and its image unless that has moved for too long already."""
        p = self._parameters
        if state.rested_s < p.track_settle_s or before is None or before.shape != left.shape:
            return False
        return state.rested_s >= p.track_still_wait_s or image_motion_px(before, left) <= p.track_still_px

    def _without(self, status: TrackStatus, reason: str) -> Track:
        return Track.nowhere(self._track_id, status, reason)

    def _lock(self, left: Image, right: Image, stamp_s: float, views: tuple[EyeView, EyeView]) -> Track:
        """Lock on what lies at the fovea."""
        self._target, point = None, _fovea(left)
        disparity = self._estimator.estimate(left, right, point)
        if disparity.status is DisparityStatus.NO_TEXTURE:
            return self._without(TrackStatus.UNLOCKED, "nothing at the fovea to lock on")
        point, extent, disparity = self._segment(left, right, point, disparity, views)
        self._track_id += 1
        self._wants_lock = False
        self._distances.clear()
        looks = Appearance(left, point, extent or _USUAL_EXTENT_PX)
        direction = views[0].direction(point)
        self._target = Target(self._track_id, stamp_s, looks, stamp_s, direction, np.zeros(3), extent is not None)
        self._target.aside_px = _aside(_fovea(left), point, extent)
        return self._tell(self._target, Sighting(point, 1.0, 0), disparity, views)

    def _segment(
        self, left: Image, right: Image, point: Pixel, disparity: Disparity, views: tuple[EyeView, EyeView]
    ) -> tuple[Pixel, tuple[float, float] | None, Disparity]:
        """Return centre, extent and disparity of the thing at a point; the point and None where it has no bounds."""
        if not disparity.ok:
            return point, None, disparity
        region = self._region(left, right, point, disparity, views)
        if not region.found or region.touches_border:
            return point, None, disparity
        if _aside(point, region.centroid_px, region.extent_px) == (0.0, 0.0):
            at_center = self._estimator.estimate(left, right, region.centroid_px, disparity.horizontal_px)
            if _plausible(at_center, disparity.horizontal_px, self._parameters.track_disparity_jump_px):
                disparity = at_center
        return region.centroid_px, region.extent_px, disparity

    def _region(
        self, left: Image, right: Image, fovea: Pixel, disparity: Disparity, views: tuple[EyeView, EyeView]
    ) -> ZeroDisparity:
        p = self._parameters
        return zero_disparity(
            left,
            right,
            fovea,
            (disparity.horizontal_px, disparity.vertical_px),
            _tolerance_px(disparity.horizontal_px, views, self._baseline_m),
            p.track_region_px,
            p.track_snap_px,
        )

    def _follow(
        self, target: Target, left: Image, right: Image, stamp_s: float, views: tuple[EyeView, EyeView]
    ) -> Track:
        """Find the target again in the next pair."""
        p = self._parameters
        expected_px = views[0].pixel(target.predicted(stamp_s))
        hidden_s = stamp_s - target.seen_s if target.hidden else 0.0
        if hidden_s > p.track_give_up_s:
            self._target, self._lost_s = None, stamp_s
            return self._without(TrackStatus.LOST, f"not seen for {hidden_s:.1f} s")
        # It went on as predicted, or stayed where it was last seen.
        places = [expected_px, views[0].pixel(target.direction)] if target.hidden else [expected_px]
        places = [place for place in places if _inside(place, left)]
        if not places:
            target.hidden = True
            return self._lost(target, f"predicted outside the left image, hidden for {hidden_s:.1f} s")
        if target.hidden:
            reach = round(p.track_search_px + p.track_search_growth_px_s * hidden_s)
            if distance(places[0], places[-1]) < reach:
                places = places[:1]
            sightings = [target.looks.search(left, place, reach) for place in places]
            sighting = max(sightings, key=lambda one: one.likeness)
            needed = p.track_reacquire_likeness
        else:
            sighting = target.looks.follow(left, expected_px)
            needed = p.track_minimum_likeness
        if sighting.likeness < needed or not _inside(sighting.pixel, left):
            target.hidden = True
            return self._lost(target, f"hidden for {hidden_s:.1f} s, best likeness {sighting.likeness:.2f}")
        looked_at = target.looked_at(sighting.pixel)
        expected_d = target.expected_disparity(looked_at, views)
        disparity = self._estimator.estimate(left, right, looked_at, expected_d)
        if not disparity.ok and looked_at != sighting.pixel:
            disparity = self._estimator.estimate(left, right, sighting.pixel, expected_d)
        if disparity.ok and expected_d is not None and target.disparity_age_s(stamp_s) < 0.5:
            jump = disparity.horizontal_px - expected_d
            # Servos without feedback are not where they say while they turn: looks that have not changed count more.
            if abs(jump) > p.track_disparity_jump_px and sighting.likeness < _UNMISTAKABLE_LIKENESS:
                target.hidden = True
                return self._lost(target, f"what is seen there has another disparity, by {jump:+.1f} px")
        if disparity.ok and not target.bounded:
            point, extent, disparity = self._segment(left, right, sighting.pixel, disparity, views)
            if extent is not None:
                # It was locked on before the right eye saw it; now its bounds are known.
                target.aside_px, target.bounded = _aside(sighting.pixel, point, extent), True
                sighting = replace(sighting, pixel=point)
                target.looks = Appearance(left, point, extent)
                target.moved(stamp_s, views[0].direction(point))
                return self._tell(target, sighting, disparity, views)
        target.looks.accept(left, sighting, renew=disparity.ok)
        target.moved(stamp_s, views[0].direction(sighting.pixel))
        return self._tell(target, sighting, disparity, views)

    def _lost(self, target: Target, reason: str) -> Track:
        return Track.nowhere(self._track_id, TrackStatus.LOST, reason, target.lock_stamp_s)

    def _tell(self, target: Target, sighting: Sighting, disparity: Disparity, views: tuple[EyeView, EyeView]) -> Track:
        """Return the track of a target that was seen in the left eye."""
        looked_at = target.looked_at(sighting.pixel)
        expected_d = target.expected_disparity(looked_at, views)
        usable = _plausible(disparity, expected_d, self._parameters.track_disparity_jump_px)
        likeness = min(max((sighting.likeness - 0.3) / 0.6, 0.0), 1.0)
        scale = target.looks.scale
        extent = (target.looks.extent_px[0] * scale, target.looks.extent_px[1] * scale)
        seen = Track(
            target.track_id,
            target.lock_stamp_s,
            sighting.pixel,
            NOWHERE,
            math.nan,
            math.nan,
            math.nan,
            extent,
            likeness * _DISTRUST_WITHOUT_DISPARITY,
            TrackStatus.OCCLUDED,
            f"not found in the right eye: {disparity.reason}",
        )
        if not usable:
            return seen
        shift = np.array([disparity.horizontal_px, disparity.vertical_px])
        right_px = (sighting.pixel[0] - shift[0], sighting.pixel[1] - shift[1])
        target.saw_right(self._stamp_s, looked_at, views, (looked_at[0] - shift[0], looked_at[1] - shift[1]))
        return replace(
            seen,
            right_px=right_px,
            disparity_px=disparity.horizontal_px,
            vertical_px=disparity.vertical_px,
            sigma_px=disparity.sigma_px,
            confidence=likeness * (1.0 if disparity.ok else 0.8),
            status=TrackStatus.OK,
            reason="" if disparity.ok else disparity.reason,
        )


def _tolerance_px(disparity_px: float, views: tuple[EyeView, EyeView], baseline_m: float) -> int:
    """Return by how much the disparity of a thing about as deep as wide may vary over it."""
    f = views[0].camera.fx_px
    parallax_rad = views[1].pan_rad - views[0].pan_rad + disparity_px / f
    # d = f b / z, so a depth of s changes it by f b s / z^2 = d^2 s / (f b).
    change_px = f * max(parallax_rad, 0.0) ** 2 * _USUAL_DEPTH_M / baseline_m
    return round(min(max(0.5 * change_px, 1.0), 5.0))


def _plausible(disparity: Disparity, expected_px: float | None, jump_px: float) -> bool:
    """Tell whether a disparity may be the target's: a good one, or an ambiguous one where it is expected."""
    if math.isnan(disparity.horizontal_px):
        return False
    if disparity.ok:
        return True
    near = expected_px is not None and abs(disparity.horizontal_px - expected_px) <= min(jump_px, 4.0)
    return disparity.status is DisparityStatus.AMBIGUOUS and near


def _aside(looked_at: Pixel, center: Pixel, extent_px: tuple[float, float] | None) -> Pixel:
    """Return how far from a region's centre the eye looks; nothing if that is beyond the region."""
    aside = (looked_at[0] - center[0], looked_at[1] - center[1])
    inside = extent_px is not None and all(abs(a) <= 0.5 * e for a, e in zip(aside, extent_px, strict=True))
    return aside if inside else (0.0, 0.0)


def _fovea(image: Image) -> Pixel:
    return (image.shape[1] - 1) / 2, (image.shape[0] - 1) / 2


def _inside(pixel: Pixel, image: Image) -> bool:
    return bool(0.0 <= pixel[0] <= image.shape[1] - 1 and 0.0 <= pixel[1] <= image.shape[0] - 1)
