"""Signed disparity at a point of the left image: estimators behind one protocol."""

from vergence_metric.disparity.estimators import make_estimator
from vergence_metric.disparity.protocol import (
    Candidate,
    Disparity,
    DisparityEstimator,
    DisparityInputError,
    DisparityStatus,
)
from vergence_metric.disparity.registry import estimator_names, register_estimator

__all__ = [
    "Candidate",
    "Disparity",
    "DisparityEstimator",
    "DisparityInputError",
    "DisparityStatus",
    "estimator_names",
    "make_estimator",
    "register_estimator",
]
