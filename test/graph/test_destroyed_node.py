"""A destroyed node is gone from the graph at once, not when Python happens to collect it.

One that is collected later ends the log on /rosout of the next node of its name in the process.
"""

import gc
from collections.abc import Iterator

import pytest
from rclpy.context import Context
from rclpy.node import Node

from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_metric.ros.box_metric_node import BoxMetricNode
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_metric.ros.eye_rotation_node import EyeRotationNode

pytestmark = pytest.mark.graph


@pytest.fixture
def uncollected() -> Iterator[None]:
    gc.disable()
    yield
    gc.enable()


@pytest.mark.parametrize("kind", [EdgeMetricNode, BoxMetricNode, EyeRotationNode, GazeControllerNode])
def test_it_leaves_the_graph_without_garbage_collection(context: Context, uncollected: None, kind: type[Node]) -> None:
    watcher, node = Node("watcher", context=context), kind(context=context)
    name = node.get_name()
    assert name in watcher.get_node_names()
    if hasattr(node, "close"):
        node.close()
    node.destroy_node()
    assert name not in watcher.get_node_names()
    watcher.destroy_node()
