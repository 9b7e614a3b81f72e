"""What is known of a target's distance: its parallax, which eyes that turn do not change, and whether it is certain."""

import math

from vergence_metric.disparity.protocol import Disparity, DisparityEstimator
from vergence_metric.tracking.depth_evidence import parallax_shares
from vergence_metric.tracking.depth_hypotheses import DepthHypotheses
from vergence_metric.tracking.eye_view import EyeView, Pixel
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.tracked_target import disparity_of_parallax, parallax, vergence_of


class TargetDepth:
    """The parallax of a target: the likeliest of its hypotheses until one is certain, then what is measured."""

    def __init__(self, disparity: Disparity, pair: StoredPair, point: Pixel, parameters: TrackerParameters) -> None:
        """Start from the disparity of a point of a pair's left image."""
        p = parameters
        self._apart_rad = p.depth_apart_rad
        self._hypotheses = DepthHypotheses(p.depth_memory, p.depth_apart_rad, p.depth_share)
        self.parallax_rad = math.nan
        """The angle between both eyes' rays, NaN where it is not known."""
        self._add(disparity, pair, point)

    @property
    def known(self) -> bool:
        """True if there is at least one hypothesis."""
        return math.isfinite(self.parallax_rad)

    @property
    def certain(self) -> bool:
        """True if only one distance fits."""
        return self._hypotheses.certain

    @property
    def doubt(self) -> str:
        """Why no distance is certain."""
        return self._hypotheses.doubt

    def weigh(self, pair: StoredPair, point: Pixel, estimator: DisparityEstimator) -> Disparity | str:
        """Add what a pair says of the distance of the target at a point of its left image.

        Returns the point's disparity if it is that of the likeliest distance, else why there is none.
        """
        disparity = estimator.estimate(pair.left, pair.right, point)
        if self._add(disparity, pair, point):
            return disparity
        return disparity.reason or "another distance is likelier"

    def _add(self, disparity: Disparity, pair: StoredPair, point: Pixel) -> bool:
        """Weigh the hypotheses by a disparity; returns whether it is that of the likeliest one."""
        answered = self._hypotheses.update(parallax_shares(disparity, point, pair), vergence_of(pair.views))
        best = self._hypotheses.best
        if best is not None and not abs(best.parallax_rad - self.parallax_rad) <= self._apart_rad:
            self.parallax_rad = best.parallax_rad
        return answered is not None and answered is best

    def measured(self, pair: StoredPair, point: Pixel, across_px: float, down_px: float) -> None:
        """Take a disparity at a point as the target's."""
        self.parallax_rad = parallax(point, pair.views, (point[0] - across_px, point[1] - down_px))

    def expected_px(self, point: Pixel, views: tuple[EyeView, EyeView]) -> float | None:
        """Return the disparity that the target has at a left pixel; None if unknown, or out of the right eye's view."""
        return disparity_of_parallax(self.parallax_rad, point, views) if self.known else None

    def candidates(self, point: Pixel, views: tuple[EyeView, EyeView]) -> tuple[tuple[float, float], ...]:
        """Return the disparities that the target may have, each with its weight; none once one is certain."""
        if self.certain:
            return ()
        ranked = ((disparity_of_parallax(h.parallax_rad, point, views), h.weight) for h in self._hypotheses.ranked)
        return tuple((disparity_px, weight) for disparity_px, weight in ranked if disparity_px is not None)
