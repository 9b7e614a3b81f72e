"""Estimators by name."""

from collections.abc import Callable

from vergence_metric.disparity.affine import AffineEstimator
from vergence_metric.disparity.protocol import DisparityEstimator
from vergence_metric.disparity.zncc import ZnccEstimator
from vergence_metric.fovea_parameters import DisparityParameters

_ESTIMATORS: dict[str, Callable[[DisparityParameters], DisparityEstimator]] = {
    "affine": AffineEstimator,
    "zncc": ZnccEstimator,
}


def make_estimator(parameters: DisparityParameters) -> DisparityEstimator:
    """Return the estimator that `parameters.disparity_estimator` names."""
    return _ESTIMATORS[parameters.disparity_estimator](parameters)


def names() -> tuple[str, ...]:
    """Return the names of all estimators."""
    return tuple(_ESTIMATORS)
