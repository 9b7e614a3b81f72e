"""One kind of estimator: a shared search finds the point, then each estimator measures there in its own way."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from vergence_metric.disparity.fovea_pair import FoveaPair
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.protocol import Disparity, DisparityEstimator, DisparityStatus, Image, Point
from vergence_metric.disparity.search import Match, find, pair_about

_DISAGREEMENT_PX = 2.0


@dataclass(frozen=True)
class LocalDisparity:
    """Horizontal and vertical disparity [px] and the standard deviation of the horizontal one [px]."""

    horizontal_px: float
    vertical_px: float
    sigma_px: float


class LocalMeasure(Protocol):
    """Measures the disparity near a match, usually to a fraction of a pixel; None where it cannot."""

    def __call__(self, pair: FoveaPair, match: Match, parameters: DisparityParameters) -> LocalDisparity | None:
        """Return the disparity measured near `match`."""
        ...


class SharedSearchEstimator(DisparityEstimator):
    """Finds the point by `search.find`, which also gives the confidence, then refines the place by `measure`."""

    def __init__(self, measure: LocalMeasure, parameters: DisparityParameters) -> None:
        self.name = parameters.estimator
        self._measure, self._parameters = measure, parameters

    def estimate_at(self, left: Image, right: Image, point_px: Point, expected_px: float | None) -> Disparity:
        """Return the disparity at a point; see DisparityEstimator."""
        pair = pair_about(left, right, point_px, self._parameters)
        match = find(pair, self._parameters, expected_px)
        measured = None if math.isnan(match.horizontal_px) else self._measure(pair, match, self._parameters)
        return self._answer(match, measured, point_px)

    def _answer(self, match: Match, measured: LocalDisparity | None, point: Point) -> Disparity:
        confidence, status, reason = match.evidence.confidence, match.status, match.reason
        kept = measured or LocalDisparity(match.horizontal_px, match.vertical_px, match.sigma_px)
        apart = abs(kept.horizontal_px - match.horizontal_px)
        if status is DisparityStatus.OK and apart > _DISAGREEMENT_PX:
            confidence, status = min(confidence, 0.5), DisparityStatus.AMBIGUOUS
            reason = f"{self.name} and the search differ by {apart:.1f} px"
        return Disparity(
            kept.horizontal_px, kept.vertical_px, kept.sigma_px, confidence, status, reason, self.name, point
        )


def shared_search(measure: LocalMeasure) -> Callable[[DisparityParameters], DisparityEstimator]:
    """Return the builder of an estimator that refines the shared search's match by `measure`."""
    return lambda parameters: SharedSearchEstimator(measure, parameters)
