"""The tracker `corner_cluster`: corners with affine transfer, and the remembered patch where a target has too few."""

import math
from functools import partial
from typing import Any

from vergence_metric.disparity.protocol import DisparityEstimator
from vergence_metric.tracking.corner_cluster import CornerCluster
from vergence_metric.tracking.eye_view import Pixel
from vergence_metric.tracking.modelled_tracker import Followed, ModelledTracker
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_metric.tracking.saccade_detector import EyeMotion
from vergence_metric.tracking.segmentation import Segmenter, layer_tolerance_px
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_metric.tracking.tracked_target import Target
from vergence_metric.tracking.tracker import TargetTracker
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics

_FEW = 6


class CornerClusterTracker(ModelledTracker, TargetTracker):
    """Follows a target by its corners, one that has fewer than six by its appearance."""

    def __init__(
        self,
        parameters: TrackerParameters,
        estimator: DisparityEstimator,
        camera: CameraModel,
        kinematics: Kinematics,
    ) -> None:
        self._learn = partial(
            learn_corner_cluster, estimator=estimator, parameters=parameters, baseline_m=kinematics.baseline_m
        )
        TargetTracker.__init__(self, parameters, estimator, camera, kinematics)

    def _requested_target(self, request: TrackRequest, pair: StoredPair) -> Any:
        target = ModelledTracker._requested_target(self, request, pair)
        return TargetTracker._requested_target(self, request, pair) if isinstance(target.model, str) else target

    def _lock(self, pair: StoredPair) -> Track:
        track = ModelledTracker._lock(self, pair)
        return TargetTracker._lock(self, pair) if track.status is TrackStatus.UNLOCKED else track

    def _follow(self, target: Followed | Target, pair: StoredPair, motion: EyeMotion) -> Track:
        if isinstance(target, Followed):
            return ModelledTracker._follow(self, target, pair, motion)
        return TargetTracker._follow(self, target, pair, motion)


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
    across = disparity.horizontal_px
    tolerance_px = layer_tolerance_px(across, pair.views, baseline_m) if math.isfinite(across) else 0.0
    cluster = CornerCluster(pair, point, region, disparity, tolerance_px, estimator, parameters)
    if len(cluster.corners) < _FEW and extent_px is None and region.extent_px is not None:
        # What was segmented is hardly a thing: the surface about the point is learnt without bounds.
        wider = region._replace(center_px=point, extent_px=None)
        cluster = CornerCluster(pair, point, wider, disparity, tolerance_px, estimator, parameters)
    count = len(cluster.corners)
    return cluster if count >= _FEW else f"it has {count} corners, fewer than {_FEW}"
