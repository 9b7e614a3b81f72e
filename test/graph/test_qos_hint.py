"""The hint of an incompatible QoS works as it is printed."""

import re
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from std_msgs.msg import String

from vergence_common.diagnostics import Diagnostics
from vergence_common.qos import check_overrides, watch_qos
from vergence_rig.parameters import UnknownParameterError

pytestmark = pytest.mark.graph

TOPIC = "/head/left/text"
LESS = QoSProfile(depth=2, reliability=QoSReliabilityPolicy.BEST_EFFORT)
MORE = QoSProfile(depth=2, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)


class Watched(Node):
    """Publishes or subscribes one topic in a namespace, by a QosWatch."""

    def __init__(self, side: str, context: Context, arguments: list[str]) -> None:
        super().__init__("watched", namespace="head", context=context, cli_args=arguments)
        diagnostics = Diagnostics(self)
        watch = watch_qos(self, diagnostics)
        self.texts: list[str] = []
        if side == "publisher":
            self.own: Any = watch.create_publisher(String, "left/text")
        else:
            self.own = watch.create_subscription(String, "left/text", lambda message: self.texts.append(message.data))


@pytest.mark.parametrize("side", ["publisher", "subscription"])
def test_the_hint_is_followed_and_the_topic_connects(side: str, graph: Any) -> None:
    texts: list[str] = []
    if side == "publisher":
        graph.client.create_subscription(String, TOPIC, lambda message: texts.append(message.data), MORE)
    else:
        publisher = graph.client.create_publisher(String, TOPIC, LESS)
    first = graph.add(Watched(side, graph.context, []))
    hint = graph.diagnostic("qos", lambda status: "start this node with" in status.message).message
    option = re.search(r"start this node with (-p \S+), or", hint)
    assert option is not None, hint
    graph.executor.remove_node(first)
    first.destroy_node()
    graph._nodes.remove(first)

    second = graph.add(Watched(side, graph.context, ["--ros-args", *option[1].split()]))
    check_overrides([second])
    if side == "publisher":
        second.own.publish(String(data="arrived"))
        graph.wait_until(lambda: texts == ["arrived"], "the latched text")
    else:

        def publish() -> bool:
            publisher.publish(String(data="arrived"))
            return bool(second.texts)

        graph.wait_until(publish, "a text")


def test_an_override_that_nothing_reads_is_refused_with_what_is_near(graph: Any) -> None:
    arguments = ["--ros-args", "-p", "qos_overrides.head/left/text.publisher.depth:=5"]
    node = graph.add(Watched("publisher", graph.context, arguments))
    with pytest.raises(UnknownParameterError, match=r"qos_overrides\./head/left/text\.publisher\.depth"):
        check_overrides([node])
