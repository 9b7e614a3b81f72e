"""Parameters of edge_metric_node: those of its input, its metric and its disparity estimator in one set."""

from dataclasses import dataclass

from vergence_metric.edge_parameters import EdgeMetricParameters
from vergence_metric.fovea_parameters import DisparityParameters
from vergence_metric.stereo_parameters import StereoParameters


@dataclass(frozen=True)
class EdgeMetricNodeParameters(StereoParameters, DisparityParameters, EdgeMetricParameters):
    """Everything edge_metric_node can be told; defaults equal config/edge_metric_node.yaml."""

    def check(self) -> None:
        """Hold every part to its own rules."""
        StereoParameters.check(self)
        DisparityParameters.check(self)
        EdgeMetricParameters.check(self)
