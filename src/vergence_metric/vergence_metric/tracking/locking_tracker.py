"""What every tracker shares: which target it follows. A requested one, else what lies at the fovea after a saccade.

When the eyes come to rest after a saccade, the tracker locks on what lies at the left fovea. A request names the point
to follow instead, and until the next request nothing else is tracked. How a target is learnt and found again is its
follower's part (`follower.py`).
"""

import math
from collections import deque
from collections.abc import Iterable
from typing import Any

from vergence_metric.disparity.protocol import Image
from vergence_metric.pairs.frame_motion import frame_motion_px
from vergence_metric.tracking.eye_view import Pixel, distance, eye_views
from vergence_metric.tracking.follower import Follower
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_metric.tracking.saccade_detector import EyeMotion, SaccadeDetector, StampedEyeAngles
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics

_KEPT_SHARE = 0.9  # of a saccade: the largest distance from the fovea at which the target was not left


class LockingTracker:
    """Follows one target; `update` must be called with every pair, in order of their stamps."""

    def __init__(
        self, follower: Follower, parameters: TrackerParameters, camera: CameraModel, kinematics: Kinematics
    ) -> None:
        self._follower = follower
        self._parameters = parameters
        self._camera, self._kinematics = camera, kinematics
        self._track_id = 0
        self.reset()

    def reset(self) -> None:
        """Drop the target and the eyes' motion; the next lock has a new id."""
        self._saccades = SaccadeDetector(self._parameters)
        self._target: Any = None
        self._requested = False
        self._wants_lock = True
        self._stamp_s = self._lost_s = -math.inf
        self._before: Image | None = None
        # Recent distances of the target from the fovea, up to the start of the current saccade: (stamp, px).
        self._distances: deque[tuple[float, float]] = deque()

    @property
    def target(self) -> Any:
        """What the follower has learnt of the target, None without one."""
        return self._target

    def request(self, request: TrackRequest, pair: StoredPair) -> None:
        """Follow a point of a stored pair from now on, on behalf of the request's goal."""
        target = self._follower.requested(self._track_id + 1, request, pair)
        self._track_id, self._target = self._track_id + 1, target
        self._wants_lock, self._requested = False, True

    def lock_here(self) -> None:
        """Lock again on the object at the fovea as soon as the eyes are at rest, as after a saccade."""
        self._target, self._requested, self._wants_lock = None, False, True

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
        pair = StoredPair(stamp_s, left, right, eye_views(self._camera, eyes, self._kinematics))
        before, self._before, self._stamp_s = self._before, left, stamp_s
        if self._target is not None and self._requested:
            return self._follow(self._target, pair, motion)
        self._wants_lock |= motion.jumped
        if self._target is not None:
            track = self._follow(self._target, pair, motion)
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
        self._target, self._requested = None, False
        return self._lock(pair)

    def _lock(self, pair: StoredPair) -> Track:
        """Lock on what lies at the fovea."""
        found = self._follower.locked(self._track_id + 1, pair)
        if isinstance(found, str):
            return self._untracked(TrackStatus.UNLOCKED, found)
        self._track_id += 1
        self._wants_lock = False
        self._distances.clear()
        self._target, track = found
        return track

    def _follow(self, target: Any, pair: StoredPair, motion: EyeMotion) -> Track:
        """Return the track of the target in the next pair."""
        track = self._follower.follow(target, pair, motion)
        if isinstance(track, str):
            self._target, self._lost_s = None, pair.stamp_s
            return self._untracked(TrackStatus.LOST, track)
        return track

    def _untracked(self, status: TrackStatus, reason: str) -> Track:
        return Track.nowhere(self._track_id, status, reason)

    def _is_kept(self, track: Track, left: Image, stamp_s: float) -> bool:
        """Return whether the eyes turned towards the target, or with it, rather than away to something else."""
        if track.status not in (TrackStatus.OK, TrackStatus.OCCLUDED):
            return False
        p = self._parameters
        away_px = distance(track.left_px, fovea_of(left))
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


def fovea_of(image: Image) -> Pixel:
    """Return the pixel of an ideal image's fovea, its middle."""
    return (image.shape[1] - 1) / 2, (image.shape[0] - 1) / 2
