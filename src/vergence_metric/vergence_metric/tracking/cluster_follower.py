"""Follows a target by its corners, and by its appearance where it has too few: the tracker `corner_cluster`."""

import math
from functools import partial

from vergence_metric.disparity.protocol import DisparityEstimator
from vergence_metric.tracking.anchored_cluster import AnchoredCluster
from vergence_metric.tracking.appearance_follower import AppearanceFollower
from vergence_metric.tracking.corner_cluster import CornerCluster
from vergence_metric.tracking.eye_view import Pixel
from vergence_metric.tracking.locking_tracker import LockingTracker
from vergence_metric.tracking.modelled_follower import Followed, ModelledFollower
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_metric.tracking.saccade_detector import EyeMotion
from vergence_metric.tracking.segmentation import Segmenter, layer_tolerance_px
from vergence_metric.tracking.track import Track
from vergence_metric.tracking.tracked_target import Target
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics

_FEW = 6


class ClusterFollower:
    """Follows a target by its corners, one that has fewer than six by its appearance; see `follower.Follower`."""

    def __init__(self, by_corners: ModelledFollower, by_appearance: AppearanceFollower) -> None:
        self._by_corners, self._by_appearance = by_corners, by_appearance

    def requested(self, track_id: int, request: TrackRequest, pair: StoredPair) -> Followed | Target:
        """Return the target of a request."""
        target = self._by_corners.requested(track_id, request, pair)
        return self._by_appearance.requested(track_id, request, pair) if isinstance(target.model, str) else target

    def locked(self, track_id: int, pair: StoredPair) -> tuple[Followed | Target, Track] | str:
        """Return the target at the left fovea with its track, or why there is none."""
        found = self._by_corners.locked(track_id, pair)
        return self._by_appearance.locked(track_id, pair) if isinstance(found, str) else found

    def follow(self, target: Followed | Target, pair: StoredPair, motion: EyeMotion) -> Track | str:
        """Return the track of a target in the next pair, or why it is given up."""
        if isinstance(target, Followed):
            return self._by_corners.follow(target, pair, motion)
        return self._by_appearance.follow(target, pair, motion)


def learn_corner_cluster(
    pair: StoredPair,
    point: Pixel,
    extent_px: tuple[float, float] | None,
    *,
    estimator: DisparityEstimator,
    parameters: TrackerParameters,
    baseline_m: float,
) -> AnchoredCluster | str:
    """Return the cluster of corners at a point of a pair, or why there is none; see `modelled_follower.Learn`."""
    disparity = estimator.estimate(pair.left, pair.right, point)
    region = Segmenter(parameters, estimator, baseline_m).segment(pair.left, pair.right, point, disparity, pair.views)
    if extent_px is not None:
        region = region._replace(center_px=point, extent_px=extent_px)
    across = disparity.horizontal_px
    tolerance_px = layer_tolerance_px(across, pair.views, baseline_m) if math.isfinite(across) else 0.0
    cluster = CornerCluster(pair, point, region, disparity, tolerance_px, estimator, parameters)
    if len(cluster.corners) < _FEW and extent_px is None and region.extent_px is not None:
        # What was segmented is hardly a thing: the surface about the point is learnt without bounds.
        wider = region._replace(center_px=point, extent_px=None)
        cluster = CornerCluster(pair, point, wider, disparity, tolerance_px, estimator, parameters)
    count = len(cluster.corners)
    return (
        AnchoredCluster(cluster, pair, point, parameters)
        if count >= _FEW
        else f"it has {count} corners, fewer than {_FEW}"
    )


def corner_cluster_tracker(
    parameters: TrackerParameters, estimator: DisparityEstimator, camera: CameraModel, kinematics: Kinematics
) -> LockingTracker:
    """Return the tracker `corner_cluster`; see `protocol.Tracker`."""
    learn = partial(learn_corner_cluster, estimator=estimator, parameters=parameters, baseline_m=kinematics.baseline_m)
    follower = ClusterFollower(
        ModelledFollower(learn, estimator, parameters),
        AppearanceFollower(parameters, estimator, kinematics.baseline_m),
    )
    return LockingTracker(follower, parameters, camera, kinematics)
