"""The estimators that ship with the package, and the one that the parameters choose."""

from vergence_metric.disparity.affine import measure_affine
from vergence_metric.disparity.cepstral import CepstralEstimator
from vergence_metric.disparity.depth_policy import DepthPolicyEstimator
from vergence_metric.disparity.edge_shift import measure_edge_shift
from vergence_metric.disparity.gabor import measure_gabor
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.phase import measure_phase
from vergence_metric.disparity.protocol import DisparityEstimator
from vergence_metric.disparity.registry import estimator_builder, register_estimator
from vergence_metric.disparity.semi_global import SemiGlobalEstimator
from vergence_metric.disparity.shared_search import shared_search
from vergence_metric.disparity.zncc import measure_zncc

register_estimator(SemiGlobalEstimator.name, SemiGlobalEstimator)
register_estimator("affine", shared_search(measure_affine))
register_estimator("zncc", shared_search(measure_zncc))
register_estimator("edge_shift", shared_search(measure_edge_shift))
register_estimator("phase", shared_search(measure_phase))
register_estimator(CepstralEstimator.name, CepstralEstimator)
register_estimator("gabor", shared_search(measure_gabor))


def make_estimator(parameters: DisparityParameters) -> DisparityEstimator:
    """Return the estimator that `parameters.estimator` names, behind the depth policy."""
    estimator = estimator_builder(parameters.estimator)(parameters)
    if parameters.depth_policy == "center":
        return estimator
    return DepthPolicyEstimator(estimator, parameters)
