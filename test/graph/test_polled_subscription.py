"""Messages of a polled subscription wait until they are taken, and wake no executor."""

from collections.abc import Iterator

import pytest
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from std_msgs.msg import Int32

from vergence_common.diagnostics import Diagnostics
from vergence_common.polled_subscription import PolledSubscription
from vergence_common.qos import watch_qos

from .conftest import Graph

pytestmark = pytest.mark.graph


@pytest.fixture
def taken() -> list[int]:
    return []


@pytest.fixture
def polled(graph: Graph, taken: list[int]) -> Iterator[PolledSubscription]:
    watch = watch_qos(graph.client, Diagnostics(graph.client))
    subscription = PolledSubscription(graph.client, watch, Int32, "numbers", lambda m: taken.append(m.data))
    yield subscription
    subscription.close()


def test_messages_wait_in_order(graph: Graph, polled: PolledSubscription, taken: list[int]) -> None:
    publisher = graph.client.create_publisher(Int32, "numbers", 10)
    graph.wait_until(lambda: publisher.get_subscription_count() > 0, "the subscription")
    seen = graph.message(Int32, "numbers", lambda m: m.data == 3)
    graph.wait_until(lambda: publisher.get_subscription_count() > 1, "both subscriptions")
    for number in (1, 2, 3):
        publisher.publish(Int32(data=number))
    graph.wait(seen)
    assert not taken

    def all_taken() -> bool:
        polled.poll()
        return len(taken) == 3

    graph.wait_until(all_taken, "three messages")
    assert taken == [1, 2, 3]
    polled.poll()
    assert taken == [1, 2, 3]


def test_a_publisher_that_offers_too_little_is_named_all_the_same(graph: Graph, taken: list[int]) -> None:
    watch = watch_qos(graph.client, Diagnostics(graph.client))
    subscription = PolledSubscription(graph.client, watch, Int32, "numbers", lambda m: taken.append(m.data))
    best_effort = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT)
    graph.client.create_publisher(Int32, "numbers", best_effort)
    graph.wait_until(lambda: "numbers" in watch.report().message, "the mismatch")
    subscription.close()
