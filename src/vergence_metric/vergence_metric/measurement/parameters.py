"""Parameters of edge_metric_node in one set: of its input, its metric, its disparity estimator and its tracker."""

from dataclasses import dataclass

from vergence_metric.disparity.parameters import DisparityParameters, TrackerParameters
from vergence_metric.edges.parameters import EdgeMetricParameters
from vergence_metric.pairs.stereo_parameters import StereoParameters
from vergence_rig.parameters import Groups


@dataclass(frozen=True)
class EdgeMetricNodeParameters(TrackerParameters, DisparityParameters, EdgeMetricParameters, StereoParameters):
    """Everything edge_metric_node can be told; defaults equal config/edge_metric_node.yaml."""

    def check(self) -> None:
        """Hold every part to its own rules."""
        for part in (TrackerParameters, DisparityParameters, EdgeMetricParameters, StereoParameters):
            part.check(self)


GROUPS: Groups = (("", EdgeMetricNodeParameters),)
