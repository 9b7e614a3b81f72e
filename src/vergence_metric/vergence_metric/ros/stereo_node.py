"""stereo_node: edge metric, boxes and eye rotation in one process; images are received, decoded and paired once."""

from collections.abc import Callable, Sequence

from rclpy.node import Node

from vergence_common.composition import Composition, parse
from vergence_common.local_images import LocalImages
from vergence_common.node_main import run_nodes
from vergence_metric.ros.box_metric_node import BoxMetricNode
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_metric.ros.eye_rotation_node import EyeRotationNode

METRICS: dict[str, Callable[..., Node]] = {
    "edge_metric_node": EdgeMetricNode,
    "box_metric_node": BoxMetricNode,
    "eye_rotation_node": EyeRotationNode,
}


def metric_makers(composition: Composition, images: LocalImages) -> list[Callable[[], Node]]:
    """Return what makes each chosen metric node; the first receives the images that `images` does not offer."""
    return [composition.maker(name, METRICS[name], images=images) for name in composition.own if name in METRICS]


def main(args: Sequence[str] | None = None) -> int:
    """Run the chosen metric nodes."""
    composition = parse(list(METRICS), list(METRICS), "Measure pairs of images: all metrics in one process.", args)
    return run_nodes(metric_makers(composition, LocalImages()), composition.common)
