"""`vergence record` beside real publishers: every message is in the bag as it came, with the types' own hashes."""

import importlib
import threading
from pathlib import Path
from typing import Any

import pytest
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rosbags.interfaces import ConnectionExtRosbag2
from rosbags.rosbag2 import Reader
from rosgraph_msgs.msg import Clock

from vergence.bags.topics import LATCHED, TOPICS
from vergence.bags.writer import BagWriter
from vergence_bringup.graph_errors import GraphError
from vergence_bringup.ros.record import Recording, message_definitions
from vergence_common.stamps import to_stamp

from .conftest import Graph

pytestmark = pytest.mark.graph


def message_class(kind: str) -> Any:
    package, _, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def test_every_topic_is_recorded_with_its_messages_and_hash(graph: Graph, tmp_path: Path) -> None:
    publishers = {
        topic: graph.client.create_publisher(
            message_class(kind),
            topic,
            QoSProfile(
                depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL if topic in LATCHED else DurabilityPolicy.VOLATILE
            ),
        )
        for topic, kind in TOPICS.items()
    }
    sent: dict[str, Any] = {}
    for topic, kind in TOPICS.items():
        sent[topic] = message_class(kind)()
        sent[topic].header.frame_id = topic
    for topic in LATCHED:
        publishers[topic].publish(sent[topic])
    with BagWriter(tmp_path / "bag", message_definitions("vergence_msgs")) as writer:
        recorder = graph.add(Node("vergence_record", context=graph.context))
        Recording(recorder, writer, tuple(TOPICS))
        for topic in sent.keys() - LATCHED:
            publisher = publishers[topic]
            graph.wait_until(lambda p=publisher: p.get_subscription_count() > 0, f"{topic} is subscribed")  # type: ignore[misc]
            publisher.publish(sent[topic])
        graph.wait_until(lambda: len(writer.counts) == len(TOPICS), "every topic has a message")
        hashes = {
            topic: str(graph.client.get_publishers_info_by_topic(f"/{topic}")[0].topic_type_hash) for topic in TOPICS
        }
    with Reader(tmp_path / "bag") as bag:
        stored = {connection.topic.lstrip("/"): (connection, data) for connection, _, data in bag.messages()}
    assert set(stored) == set(TOPICS)
    for topic, (connection, data) in stored.items():
        assert connection.msgtype == TOPICS[topic]
        assert connection.digest == hashes[topic], topic
        assert deserialize_message(bytes(data), message_class(TOPICS[topic])) == sent[topic]
        assert isinstance(connection.ext, ConnectionExtRosbag2)
        transient = connection.ext.offered_qos_profiles[0].durability.name == "TRANSIENT_LOCAL"
        assert transient == (topic in LATCHED)


def test_arrivals_are_in_the_time_of_clock(graph: Graph, tmp_path: Path) -> None:
    clock = graph.client.create_publisher(Clock, "/clock", 1)
    joints = graph.client.create_publisher(message_class(TOPICS["joint_states"]), "joint_states", 10)
    with BagWriter(tmp_path / "bag") as writer:
        recording = Recording(graph.add(Node("vergence_record", context=graph.context)), writer, ("joint_states",))
        graph.wait_until(lambda: clock.get_subscription_count() > 0, "/clock is subscribed")
        clock.publish(Clock(clock=to_stamp(7.5)))
        graph.wait_until(lambda: recording.clock_ns == 7_500_000_000, "/clock has arrived")
        graph.wait_until(lambda: joints.get_subscription_count() > 0, "joint_states is subscribed")
        joints.publish(message_class(TOPICS["joint_states"])())
        graph.wait_until(lambda: bool(writer.counts), "joint_states has arrived")
    with Reader(tmp_path / "bag") as bag:
        assert [arrival_ns for _, arrival_ns, _ in bag.messages()] == [7_500_000_000]


def test_a_graph_without_a_head_is_named(graph: Graph, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        node = Node("vergence_record", context=graph.context)
        with pytest.raises(GraphError, match="is it running"):
            Recording(node, writer, ("joint_states",)).run(threading.Event(), None, 0.2)
        node.destroy_node()
