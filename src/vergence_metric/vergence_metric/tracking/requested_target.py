"""A target that was asked for by its place in one image: learnt there, found again after the eyes have turned."""

import math
from dataclasses import replace

import numpy as np

from vergence_metric.disparity.protocol import Disparity, DisparityEstimator, Image
from vergence_metric.tracking.depth_evidence import parallax_shares
from vergence_metric.tracking.depth_hypotheses import DepthHypotheses
from vergence_metric.tracking.eye_view import EyeView, Pixel, distance
from vergence_metric.tracking.own_pixels import SurfaceMasks
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.remembered_patch import NEVER, RememberedPatch
from vergence_metric.tracking.request import StoredPair, TrackRequest, check_inside
from vergence_metric.tracking.sighted import in_both_eyes, in_left_eye
from vergence_metric.tracking.surroundings import surroundings_disparity
from vergence_metric.tracking.target_appearance import Sighting, TargetAppearance
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_metric.tracking.tracked_target import (
    Target,
    disparity_of_parallax,
    distance_of_parallax,
    parallax,
    vergence_of,
)

USUAL_EXTENT_PX = (60.0, 60.0)
_TURNED_PX = 2.0  # change of the vergence since the last match up to which the expected disparity is searched alone
_REST_PX, _MOVED_PX, _MOVED_SHARE = 4.0, 8.0, 0.3  # how far a visible target may be from where it is expected
_LATE_PX = 12.0  # by which it was found off from where play explains it: the joints had turned before they said so


def requested_target(
    track_id: int,
    request: TrackRequest,
    pair: StoredPair,
    estimator: DisparityEstimator,
    parameters: TrackerParameters,
) -> Target:
    """Return the target of a request, as it is in the pair in which it was asked for, to be found in the next one."""
    point = request.pixel if request.left_eye else pixel_in_left_eye(request.pixel, pair, estimator)
    patch = RememberedPatch(pair.left, pair.views[0], point, surroundings_m(pair, point))
    appearance = TargetAppearance(pair.left, point, request.extent_px or USUAL_EXTENT_PX)
    target = Target(track_id, pair.stamp_s, appearance, pair.stamp_s, pair.views, patch.direction, np.zeros(3), True)
    target.patch, target.goal_id, target.hidden, target.found = patch, request.goal_id, True, False
    target.depths = DepthHypotheses(parameters.depth_memory, parameters.depth_apart_rad, parameters.depth_share)
    disparity = estimator.estimate(pair.left, pair.right, point)
    weigh_depths(target, target.depths, disparity, point, pair)
    # Even where no match is sure: which one is the target's is known later.
    may_be = [disparity.horizontal_px, *(one.disparity_px for one in disparity.candidates)]
    distances = [(parallax(point, pair.views, (point[0] - px, point[1])), px) for px in may_be if math.isfinite(px)]
    target.masks = SurfaceMasks(pair.left, pair.right, point, distances, parameters.depth_apart_rad)
    return target


def surroundings_m(pair: StoredPair, left_px: Pixel) -> float | None:
    """Return how far away most of what surrounds a point of a pair is [m]; None where that cannot be seen."""
    disparity_px = surroundings_disparity(pair.left, pair.right, left_px)
    if disparity_px is None:
        return None
    angle = parallax(left_px, pair.views, (left_px[0] - disparity_px, left_px[1]))
    return distance_of_parallax(angle, pair.views[0].direction(left_px), pair.views)


def weigh_depths(
    target: Target, depths: DepthHypotheses, disparity: Disparity, left_px: Pixel, pair: StoredPair
) -> bool:
    """Add what a pair says of the target's distance; returns whether it is the likeliest by now."""
    answered = depths.update(parallax_shares(disparity, left_px, pair), vergence_of(pair.views))
    if depths.best is not None:
        target.parallax_rad = depths.best.parallax_rad
    return answered is not None and answered is depths.best


def track_requested(
    target: Target,
    depths: DepthHypotheses,
    sighting: Sighting,
    pair: StoredPair,
    estimator: DisparityEstimator,
    largest_spread_px: float,
) -> Track:
    """Return the track of a requested target that was found in the left eye: at its likeliest distance so far.

    It is AMBIGUOUS while no distance is certain, or while places farther than `largest_spread_px` look as much like it.
    """
    views = pair.views
    if target.patch is not None and target.patch.surroundings_m is None:
        target.patch.surroundings_m = surroundings_m(pair, sighting.pixel)
    # Hobby servos do not turn by what they report: after a move in depth a search about what is expected would find the
    # next repetition of a texture there.
    turned_px = abs(vergence_of(views) - target.matched_vergence_rad) * views[0].camera.fx_px
    known = depths.certain and turned_px <= _TURNED_PX
    expected_px = target.expected_disparity(sighting.pixel, views) if known else None
    disparity = estimator.estimate(pair.left, pair.right, sighting.pixel, expected_px)
    likeliest = weigh_depths(target, depths, disparity, sighting.pixel, pair)
    target.appearance.accept(pair.left, sighting, renew=disparity.ok)
    target.off_px = distance(views[0].pixel(target.direction), sighting.pixel)
    target.update_direction(pair.stamp_s, views[0].direction(sighting.pixel))
    track = in_left_eye(target, sighting, disparity.reason or "another distance is likelier")
    ranked = [(disparity_of_parallax(one.parallax_rad, sighting.pixel, views), one.weight) for one in depths.ranked]
    track = replace(track, candidates=tuple((d, weight) for d, weight in ranked if d is not None))
    if likeliest:
        track = in_both_eyes(track, target, disparity, views, pair.stamp_s)
    if not depths.certain:
        return replace(track, status=TrackStatus.AMBIGUOUS, reason=depths.doubt)
    if sighting.spread_px > largest_spread_px:
        reason = f"the target's place is not certain: {sighting.spread_px:.0f} px beside it looks the same"
        return replace(track, status=TrackStatus.AMBIGUOUS, reason=reason, candidates=())
    return track


def find_by_surroundings(
    target: Target, patch: RememberedPatch, left: Image, stamp_s: float, view: EyeView, parameters: TrackerParameters
) -> Sighting | None:
    """Return where a requested target that rests is, by what surrounded it at its request; None where it is not known.

    The surroundings are larger than the target and surer: along an edge the target looks the same everywhere, and
    servos that do not turn as they report would carry it along. Of a target that moves they say nothing: one that was
    visible and no longer looks like itself where they are has left them. Before it is found for the first time, its
    best place is returned however unlike it is.
    """
    p = parameters
    # Joints that report no move have mostly not moved; those that do may rest in their play, or lag behind. What their
    # report lacked in the last pair it has in this one.
    moved_px = distance(view.pixel(target.direction), target.appearance.pixel)
    late_px = target.off_px if target.off_px > _LATE_PX else 0.0
    reach_px = _REST_PX + late_px + (_MOVED_PX + _MOVED_SHARE * moved_px if moved_px > 0.5 else 0.0)
    reach_px = min(reach_px, p.search_px)
    if target.hidden:
        reach_px = p.request_search_px + p.search_growth_px_s * (stamp_s - target.seen_s)
        reach_px = min(reach_px, p.request_search_max_px)
    alone_below = p.request_similarity if target.hidden else NEVER
    found = patch.find(left, view, target.direction, round(reach_px), alone_below, target.distance_m, target.own)
    if found is None:
        return None
    alike = found.similarity >= p.request_similarity
    if alike:
        target.most_at_point = max(target.most_at_point, found.at_point)
    itself = found.at_point >= target.most_at_point - (1.0 - p.anchor_similarity)
    if target.found and not (alike and (target.hidden or itself)):
        return None
    if alike and target.hidden:
        target.appearance = TargetAppearance(left, found.pixel, target.appearance.extent_px)
        target.found = True
    else:
        target.appearance.drop_features()
    return Sighting(found.pixel, found.similarity, 0, found.spread_px)


def without_drift(
    target: Target,
    patch: RememberedPatch,
    followed: Sighting,
    left: Image,
    view: EyeView,
    parameters: TrackerParameters,
) -> Sighting:
    """Return the sighting put right where the point, as it was when it was requested, is clearly beside it."""
    p = parameters
    anchor, here = patch.refine(left, view, followed.pixel, p.anchor_px, target.distance_m, target.own)
    # Along an edge, or without texture, other places look as much like it: only a clear gain is drift.
    if anchor.similarity < max(p.anchor_similarity, here + p.anchor_gain):
        return followed
    return replace(followed, pixel=anchor.pixel, similarity=max(followed.similarity, anchor.similarity))


def pixel_in_left_eye(pixel: Pixel, pair: StoredPair, estimator: DisparityEstimator) -> Pixel:
    """Return where a point of the right image is in the left one; where it would be at infinity if not matched.

    Raises RequestedPointError for a point that the left eye does not see.
    """
    last = pair.right.shape[1] - 1
    right, left = (np.ascontiguousarray(image[:, ::-1]) for image in (pair.right, pair.left))
    # Mirrored, the right image is the left one of a pair.
    disparity = estimator.estimate(right, left, (last - pixel[0], pixel[1]))
    if not disparity.ok:
        found = pair.views[0].pixel(pair.views[1].direction(pixel))
    else:
        found = pixel[0] + disparity.horizontal_px, pixel[1] - disparity.vertical_px
    check_inside(found, pair.left, otherwise="the left eye does not see it: ")
    return found
