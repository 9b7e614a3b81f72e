"""Estimators by name."""

from vergence_metric.disparity.affine import measure_affine
from vergence_metric.disparity.cepstral import measure_cepstral
from vergence_metric.disparity.depth_policy import DepthPolicyEstimator
from vergence_metric.disparity.edge_shift import measure_edge_shift
from vergence_metric.disparity.gabor import measure_gabor
from vergence_metric.disparity.measured import Measure, MeasuredEstimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.phase import measure_phase
from vergence_metric.disparity.protocol import DisparityEstimator
from vergence_metric.disparity.zncc import measure_zncc

_MEASURES: dict[str, Measure] = {
    "affine": measure_affine,
    "zncc": measure_zncc,
    "edge_shift": measure_edge_shift,
    "phase": measure_phase,
    "cepstral": measure_cepstral,
    "gabor": measure_gabor,
}


def names() -> tuple[str, ...]:
    """Return the names of all estimators."""
    return tuple(_MEASURES)


def make_estimator(parameters: DisparityParameters) -> DisparityEstimator:
    """Return the estimator that `parameters.disparity_estimator` names, behind the depth policy."""
    name = parameters.disparity_estimator
    estimator = MeasuredEstimator(name, _MEASURES[name], parameters)
    if parameters.disparity_depth_policy == "center":
        return estimator
    return DepthPolicyEstimator(estimator, parameters)
