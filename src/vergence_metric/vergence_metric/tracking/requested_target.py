"""A target that was asked for by its place in one image: learnt there, found again after the eyes have turned."""

from dataclasses import replace

import numpy as np

from vergence_metric.disparity.protocol import DisparityEstimator, Image
from vergence_metric.tracking.eye_view import EyeView, Pixel
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.remembered_patch import RememberedPatch
from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_metric.tracking.target_appearance import Sighting, TargetAppearance
from vergence_metric.tracking.tracked_target import Target

USUAL_EXTENT_PX = (60.0, 60.0)


def requested_target(track_id: int, request: TrackRequest, pair: StoredPair, estimator: DisparityEstimator) -> Target:
    """Return the target of a request, as it is in the pair in which it was asked for, to be found in the next one."""
    point = request.pixel if request.left_eye else _in_left_eye(request.pixel, pair, estimator)
    patch = RememberedPatch(pair.left, pair.views[0], point)
    appearance = TargetAppearance(pair.left, point, request.extent_px or USUAL_EXTENT_PX)
    target = Target(track_id, pair.stamp_s, appearance, pair.stamp_s, patch.direction, np.zeros(3), True)
    target.patch, target.goal_id, target.hidden, target.found = patch, request.goal_id, True, False
    disparity = estimator.estimate(pair.left, pair.right, point)
    if disparity.ok:
        shifted = (point[0] - disparity.horizontal_px, point[1] - disparity.vertical_px)
        target.update_parallax(pair.stamp_s, point, pair.views, shifted)
    return target


def find_by_surroundings(
    target: Target, patch: RememberedPatch, left: Image, stamp_s: float, view: EyeView, parameters: TrackerParameters
) -> Sighting | None:
    """Return where a requested target that rests is, by what surrounded it at its request; None outside the image.

    The surroundings are larger than the target and surer; of a target that moves they say nothing.
    """
    reach_px = parameters.request_search_px + parameters.search_growth_px_s * (stamp_s - target.seen_s)
    reach_px = min(reach_px, parameters.request_search_max_px)
    found = patch.find(left, view, target.predicted(stamp_s), round(reach_px))
    if found is None:
        return None
    if found.similarity >= parameters.request_similarity:
        target.appearance = TargetAppearance(left, found.pixel, target.appearance.extent_px)
        target.found = True
    return Sighting(found.pixel, found.similarity, 0)


def without_drift(
    followed: Sighting, patch: RememberedPatch, left: Image, view: EyeView, parameters: TrackerParameters
) -> Sighting:
    """Return the sighting put right where the point, as it was when it was requested, is clearly beside it."""
    p = parameters
    anchor, here = patch.refine(left, view, followed.pixel, p.anchor_px)
    # Along an edge, or without texture, other places look as much like it: only a clear gain is drift.
    if anchor.similarity < max(p.anchor_similarity, here + p.anchor_gain):
        return followed
    return replace(followed, pixel=anchor.pixel, similarity=max(followed.similarity, anchor.similarity))


def _in_left_eye(pixel: Pixel, pair: StoredPair, estimator: DisparityEstimator) -> Pixel:
    """Return where a point of the right image is in the left one; where it would be at infinity if not matched."""
    last = pair.right.shape[1] - 1
    right, left = (np.ascontiguousarray(image[:, ::-1]) for image in (pair.right, pair.left))
    # Mirrored, the right image is the left one of a pair.
    disparity = estimator.estimate(right, left, (last - pixel[0], pixel[1]))
    if not disparity.ok:
        return pair.views[0].pixel(pair.views[1].direction(pixel))
    return pixel[0] + disparity.horizontal_px, pixel[1] - disparity.vertical_px
