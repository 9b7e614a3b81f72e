"""What the estimators share that measure about the place where the search found the point."""

import math
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import radius_of
from vergence_metric.disparity.fovea_pair import FoveaPair, Grey, Strip
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.protocol import Disparity, DisparityEstimator, DisparityStatus, Image, Point
from vergence_metric.disparity.search import Match, find, pair_about

_DISAGREEMENT_PX = 2.0


@dataclass(frozen=True)
class Measured:
    """Horizontal and vertical disparity [px] and the standard deviation of the horizontal one [px]."""

    horizontal_px: float
    vertical_px: float
    sigma_px: float


class Measure(Protocol):
    """Measures the disparity about where a match says the point is; None where it cannot."""

    def __call__(self, pair: FoveaPair, match: Match, parameters: DisparityParameters) -> Measured | None:
        """Return what is measured about `match`."""
        ...


class MeasuredEstimator(DisparityEstimator):
    """Finds the point by `search.find`, which also says how sure it is, then measures there in its own way."""

    def __init__(self, name: str, measure: Measure, parameters: DisparityParameters) -> None:
        self.name = name
        self._measure, self._parameters = measure, parameters

    def estimate_at(self, left: Image, right: Image, point_px: Point, expected_px: float | None) -> Disparity:
        """Return the disparity at a point; see DisparityEstimator."""
        pair = pair_about(left, right, point_px, self._parameters)
        match = find(pair, self._parameters, expected_px)
        measured = None if math.isnan(match.horizontal_px) else self._measure(pair, match, self._parameters)
        return self._answer(match, measured, point_px)

    def _answer(self, match: Match, measured: Measured | None, point: Point) -> Disparity:
        confidence, status, reason = match.evidence.confidence, match.status, match.reason
        kept = measured or Measured(match.horizontal_px, match.vertical_px, match.sigma_px)
        apart = abs(kept.horizontal_px - match.horizontal_px)
        if status is DisparityStatus.OK and apart > _DISAGREEMENT_PX:
            confidence, status = min(confidence, 0.5), DisparityStatus.AMBIGUOUS
            reason = f"{self.name} and the search differ by {apart:.1f} px"
        return Disparity(
            kept.horizontal_px, kept.vertical_px, kept.sigma_px, confidence, status, reason, self.name, point
        )


def window_about(strip: Strip, x: float, y: float, side: int) -> Grey:
    """Return the (side, side) window whose centre is the point (x, y) of the full image, resampled."""
    center = (x - strip.x0, y - strip.y0)
    return np.asarray(cv2.getRectSubPix(strip.grey, (side, side), center, patchType=cv2.CV_32F))


def tapered(window: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Return the window less its weighted mean, faded out by a Gaussian."""
    half = (window.shape[0] - 1) / 2
    line = np.exp(-0.5 * ((np.arange(window.shape[0]) - half) / sigma) ** 2).astype(np.float32)
    weights = np.outer(line, line)
    return (window - float((weights * window).sum() / weights.sum())) * weights


def measuring_window_px(match: Match, parameters: DisparityParameters) -> float:
    """Return the window to measure in: the one that decided, as it holds one surface, but no less than the second."""
    windows = parameters.disparity_windows_px
    return max(match.window_px, windows[min(1, len(windows) - 1)])


def side_of(sigma: float) -> int:
    """Return the side of a window that holds a Gaussian of this deviation, a whole multiple of 8."""
    return 8 * math.ceil((2 * radius_of(sigma) + 1) / 8)
