"""Disparity by normalised cross-correlation of the fovea, with a sub-pixel peak."""

from vergence_metric.disparity.protocol import Disparity, Image, checked_point
from vergence_metric.disparity.search import Match, find, pair_about
from vergence_metric.fovea_parameters import DisparityParameters


class ZnccEstimator:
    """Zero-mean normalised cross-correlation in Gaussian windows, see `search.find`; a parabola finds the peak."""

    name = "zncc"

    def __init__(self, parameters: DisparityParameters) -> None:
        self._parameters = parameters

    def estimate(
        self,
        left: Image,
        right: Image,
        point_px: tuple[float, float] | None = None,
        expected_px: float | None = None,
    ) -> Disparity:
        """Return the disparity at a point; see DisparityEstimator."""
        point = checked_point(left, right, point_px)
        match = find(pair_about(left, right, point, self._parameters), self._parameters, expected_px)
        return answer(match, self.name, point)


def answer(match: Match, estimator: str, point_px: tuple[float, float]) -> Disparity:
    """Return a match as an answer."""
    return Disparity(
        match.horizontal_px,
        match.vertical_px,
        match.sigma_px,
        match.evidence.confidence,
        match.status,
        match.reason,
        estimator,
        point_px,
    )
