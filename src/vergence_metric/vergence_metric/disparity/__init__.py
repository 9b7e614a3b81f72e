"""Signed disparity at a point of the left image: estimators behind one protocol."""

from vergence_metric.disparity.protocol import Disparity, DisparityEstimator, DisparityInputError, DisparityStatus
from vergence_metric.disparity.registry import make_estimator

__all__ = ["Disparity", "DisparityEstimator", "DisparityInputError", "DisparityStatus", "make_estimator"]
