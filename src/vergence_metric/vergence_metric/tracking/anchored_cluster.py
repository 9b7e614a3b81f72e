"""A cluster of corners that is checked by what its point looked like when it was learnt, and is found again by that.

Corners say how a target moves and turns, and where it is while a part of it is covered. What surrounded its point
(`remembered_patch.py`) says where the eyes have turned to although the joints report it wrongly, and that corners have
slid along a texture that repeats. So the corners lead. Where they are lost, or the point is seen elsewhere and looks
there at least as much like itself, they are learnt anew. What has moved away or turned has left its surroundings: where
these are it no longer looks like itself.
"""

from vergence_metric.tracking.corner_cluster import CornerCluster
from vergence_metric.tracking.eye_view import Pixel, distance, is_inside
from vergence_metric.tracking.known_corners import KnownCorners
from vergence_metric.tracking.modelled_follower import Fix
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.remembered_patch import NEVER, PatchSighting, RememberedPatch
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.saccade_detector import EyeMotion

_ALONE = 2.0  # no correlation is above it
_APART_PX = 4.0  # places closer than this are one: that of the corners is the more accurate


class AnchoredCluster:
    """The corners of a target, and the appearance of its point in the pair in which both were learnt."""

    def __init__(self, cluster: CornerCluster, pair: StoredPair, point: Pixel, parameters: TrackerParameters) -> None:
        self._cluster, self._parameters = cluster, parameters
        self._patch = RememberedPatch(pair.left, pair.views[0], point)
        self._direction = self._patch.direction  # where the point was last
        self._most_at_point = 0.0  # what noise leaves of its similarity with itself

    @property
    def corners(self) -> KnownCorners:
        """The corners of the target."""
        return self._cluster.corners

    def locate(self, pair: StoredPair, hidden_s: float, motion: EyeMotion) -> Fix | str:
        """Return where the point is in the next pair; see `modelled_follower.TargetModel`."""
        p, fix = self._parameters, self._cluster.locate(pair, hidden_s, motion)
        if isinstance(fix, str):
            reach_px = min(p.request_search_px + p.search_growth_px_s * hidden_s, p.request_search_max_px)
            # Beside surroundings that it has left, the point itself may be unmistakable.
            seen = self._seen(pair, reach_px, p.request_similarity) or self._seen(pair, reach_px, _ALONE)
            if seen is None:
                return fix
            fix = self._cluster.relock(pair, seen.pixel, motion)
        else:
            seen = self._seen(pair, p.search_px, NEVER)
            if seen is not None and distance(seen.pixel, fix.left_px) > _APART_PX:
                here, _ = self._patch.refine(pair.left, pair.views[0], fix.left_px, 1)
                if seen.at_point >= here.at_point:
                    fix = self._cluster.relock(pair, seen.pixel, motion)
        self._direction = pair.views[0].direction(fix.left_px)
        return fix

    def _seen(self, pair: StoredPair, reach_px: float, alone_below: float) -> PatchSighting | None:
        """Return where the point is, None where its surroundings are not seen, or it is not in them."""
        p = self._parameters
        seen = self._patch.find(pair.left, pair.views[0], self._direction, round(reach_px), alone_below)
        if seen is None or seen.similarity < p.request_similarity or not is_inside(seen.pixel, pair.left):
            return None
        self._most_at_point = max(self._most_at_point, seen.at_point)
        return seen if seen.at_point >= self._most_at_point - (1.0 - p.anchor_similarity) else None
