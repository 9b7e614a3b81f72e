"""A follower for any model of a target that can be learnt at a point of one pair and located in the next ones.

The lock, the request, loss and giving up are the same for all models; a model says where the target is, or why it
cannot say.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

from vergence_metric.disparity.protocol import DisparityEstimator
from vergence_metric.tracking.eye_view import Pixel
from vergence_metric.tracking.locking_tracker import LockingTracker, fovea_of
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_metric.tracking.requested_target import pixel_in_left_eye
from vergence_metric.tracking.saccade_detector import EyeMotion
from vergence_metric.tracking.track import NOWHERE, Track, TrackStatus
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics

_CONFIDENCE_WITHOUT_DISPARITY = 0.6


@dataclass(frozen=True)
class Fix:
    """Where a target is in a pair; the disparity is NaN where it is not found in the right eye, and `reason` says why.

    `confidence` is 0 to 1, for the position in the left eye alone. `candidates` are the disparities that it may have,
    each with its likelihood, while several fit: then the disparity is the likeliest one's.
    """

    left_px: Pixel
    disparity_px: float
    vertical_px: float
    sigma_px: float
    extent_px: Pixel
    confidence: float
    reason: str = ""
    candidates: tuple[tuple[float, float], ...] = ()


class TargetModel(Protocol):
    """What a tracker has learnt of its target."""

    def locate(self, pair: StoredPair, hidden_s: float, motion: EyeMotion) -> Fix | str:
        """Return where the target is in the next pair, else why that is not known.

        `hidden_s` is the time since it was last located [s].
        """
        ...


Learn = Callable[[StoredPair, Pixel, "tuple[float, float] | None"], "TargetModel | str"]
"""Learns a target at a point (x, y) of a pair's left image, of an extent (w, h) [px] or None; or why it cannot."""


@dataclass
class Followed:
    """The target that is followed; `model` is the reason where nothing could be learnt."""

    track_id: int
    lock_stamp_s: float
    goal_id: int
    model: TargetModel | str
    seen_s: float

    @staticmethod
    def model_of(target: object) -> TargetModel | None:
        """Return the model of a tracker's target, None where there is none."""
        return target.model if isinstance(target, Followed) and not isinstance(target.model, str) else None


class ModelledFollower:
    """Follows a target by a model that `learn` makes of it; see `follower.Follower`."""

    def __init__(self, learn: Learn, estimator: DisparityEstimator, parameters: TrackerParameters) -> None:
        self._learn, self._estimator, self._parameters = learn, estimator, parameters

    def requested(self, track_id: int, request: TrackRequest, pair: StoredPair) -> Followed:
        """Return the target of a request."""
        point = request.pixel if request.left_eye else pixel_in_left_eye(request.pixel, pair, self._estimator)
        model = self._learn(pair, point, request.extent_px)
        return Followed(track_id, pair.stamp_s, request.goal_id, model, pair.stamp_s)

    def locked(self, track_id: int, pair: StoredPair) -> tuple[Followed, Track] | str:
        """Return the target at the left fovea with its track, or why there is none."""
        model = self._learn(pair, fovea_of(pair.left), None)
        if isinstance(model, str):
            return f"nothing at the fovea to lock on: {model}"
        target = Followed(track_id, pair.stamp_s, 0, model, pair.stamp_s)
        track = self.follow(target, pair, EyeMotion(False, False, 0.0))
        return track if isinstance(track, str) else (target, track)

    def follow(self, target: Followed, pair: StoredPair, motion: EyeMotion) -> Track | str:
        """Return the track of a target in the next pair, or why it is given up."""
        if isinstance(target.model, str):
            reason = f"the requested point cannot be followed: {target.model}"
            return _nowhere(target, TrackStatus.UNLOCKED, reason)
        hidden_s = pair.stamp_s - target.seen_s
        fix = target.model.locate(pair, hidden_s, motion)
        if isinstance(fix, str):
            if hidden_s > self._parameters.give_up_s and not target.goal_id:
                return f"target lost: not found for {hidden_s:.1f} s"
            return _nowhere(target, TrackStatus.LOST, f"target hidden for {hidden_s:.1f} s: {fix}")
        target.seen_s = pair.stamp_s
        return _track(target, fix)


def _track(target: Followed, fix: Fix) -> Track:
    seen = math.isfinite(fix.disparity_px)
    if fix.candidates:
        status, reason = TrackStatus.AMBIGUOUS, fix.reason
    elif seen:
        status, reason = TrackStatus.OK, ""
    else:
        status, reason = TrackStatus.OCCLUDED, f"target not found in the right eye: {fix.reason}"
    right_px = (fix.left_px[0] - fix.disparity_px, fix.left_px[1] - fix.vertical_px) if seen else NOWHERE
    return Track(
        target.track_id,
        target.lock_stamp_s,
        fix.left_px,
        right_px,
        fix.disparity_px,
        fix.vertical_px if seen else math.nan,
        fix.sigma_px if seen else math.nan,
        fix.extent_px,
        fix.confidence * (1.0 if seen else _CONFIDENCE_WITHOUT_DISPARITY),
        status,
        reason,
        target.goal_id,
        fix.candidates,
    )


def _nowhere(target: Followed, status: TrackStatus, reason: str) -> Track:
    return replace(Track.nowhere(target.track_id, status, reason, target.lock_stamp_s), goal_id=target.goal_id)


def modelled_tracker(
    learn: Learn,
    estimator: DisparityEstimator,
    parameters: TrackerParameters,
    camera: CameraModel,
    kinematics: Kinematics,
) -> LockingTracker:
    """Return the tracker of one kind of model."""
    return LockingTracker(ModelledFollower(learn, estimator, parameters), parameters, camera, kinematics)
