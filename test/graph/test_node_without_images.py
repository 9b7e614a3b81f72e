"""A metric node without images says in its log what it waits for."""

import socket

import pytest
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import Image

from vergence_common import awaited
from vergence_metric.ros.edge_metric_node import EdgeMetricNode

from .conftest import Graph

pytestmark = pytest.mark.graph


def waiting(graph: Graph) -> Future:
    """Return a future of the log message, also of one that was sent before this subscription was found."""
    qos = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    return graph.message(Log, "/rosout", lambda log: "waiting for" in log.msg, qos)


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(awaited, "NOTICE_AFTER_S", 0.2)


def test_a_node_without_images_names_both_topics_and_who_publishes_them(graph: Graph) -> None:
    said = waiting(graph)
    graph.start(EdgeMetricNode)
    text = graph.wait(said).msg
    assert "/left/image_raw and /right/image_raw: nothing publishes there" in text
    assert "camera_node" in text


def test_the_diagnostics_of_a_node_without_hardware_name_its_computer(graph: Graph) -> None:
    graph.start(EdgeMetricNode)
    assert graph.diagnostic("edge_metric_node: pairs", lambda status: True).hardware_id == socket.gethostname()


def test_a_publisher_that_sends_nothing_is_counted(graph: Graph) -> None:
    graph.client.create_publisher(Image, "left/image_raw", 2)
    said = waiting(graph)
    graph.start(EdgeMetricNode)
    assert "/left/image_raw 1, /right/image_raw 0" in graph.wait(said).msg
