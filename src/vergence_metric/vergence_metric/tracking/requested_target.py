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
    target.patch, target.goal_id, target.hidden = patch, request.goal_id, True
    disparity = estimator.estimate(pair.left, pair.right, point)
    if disparity.ok:
        shifted = (point[0] - disparity.horizontal_px, point[1] - disparity.vertical_px)
        target.update_parallax(pair.stamp_s, point, pair.views, shifted)
    return target


def find_requested(
    target: Target, patch: RememberedPatch, left: Image, stamp_s: float, view: EyeView, parameters: TrackerParameters
) -> Sighting | None:
    """Return the best sighting of a requested target in the left image; None if it is predicted outside."""
    p, direction = parameters, target.predicted(stamp_s)
    if target.hidden:
        reach_px = p.request_search_px + p.search_growth_px_s * (stamp_s - target.seen_s)
        found = patch.find(left, view, direction, min(round(reach_px), p.request_search_max_px))
        if found is None:
            return None
        if found.similarity >= p.request_similarity:
            target.appearance = TargetAppearance(left, found.pixel, target.appearance.extent_px)
        return Sighting(found.pixel, found.similarity, 0)
    expected = view.pixel(direction)
    if not _is_inside(expected, left):
        return None
    followed = target.appearance.follow(left, expected)
    direction = view.direction(followed.pixel)
    anchor, here = patch.find(left, view, direction, p.anchor_px), patch.find(left, view, direction, 1)
    if anchor is None or here is None or anchor.similarity < p.anchor_similarity:
        return followed
    # Along an edge, or without texture, other places look as much like it: only a clear gain is drift.
    drifted = anchor.similarity > here.similarity + p.anchor_gain
    pixel = anchor.pixel if drifted else followed.pixel
    return replace(followed, pixel=pixel, similarity=max(followed.similarity, anchor.similarity))


def _in_left_eye(pixel: Pixel, pair: StoredPair, estimator: DisparityEstimator) -> Pixel:
    """Return where a point of the right image is in the left one; where it would be at infinity if not matched."""
    last = pair.right.shape[1] - 1
    right, left = (np.ascontiguousarray(image[:, ::-1]) for image in (pair.right, pair.left))
    # Mirrored, the right image is the left one of a pair.
    disparity = estimator.estimate(right, left, (last - pixel[0], pixel[1]))
    if not disparity.ok:
        return pair.views[0].pixel(pair.views[1].direction(pixel))
    return pixel[0] + disparity.horizontal_px, pixel[1] - disparity.vertical_px


def _is_inside(pixel: Pixel, image: Image) -> bool:
    return bool(0.0 <= pixel[0] <= image.shape[1] - 1 and 0.0 <= pixel[1] <= image.shape[0] - 1)
