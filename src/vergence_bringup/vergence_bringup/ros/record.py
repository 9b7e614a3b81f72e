"""`vergence record`: a running head into a bag, message for message as they come from the wire."""

import argparse
import importlib
import signal
import sys
import threading
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import rclpy
from ament_index_python.packages import get_package_share_directory
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

from vergence.bags.topics import LATCHED, SIDES, TOPICS
from vergence.bags.writer import BagWriter
from vergence_bringup.graph_errors import GraphError
from vergence_common.stamps import to_nanoseconds
from vergence_common.start import checked_namespace, init
from vergence_rig.regular_file import expanded

_SLICE_S = 0.1
_DEPTH = 50
_BEST_EFFORT, _RELIABLE = ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `vergence record`."""
    parser.add_argument("bag", type=expanded, metavar="BAG", help="folder of the new bag, which must not exist")
    parser.add_argument("--duration", type=_positive, metavar="S", help="end after S seconds (default: at Ctrl-C)")
    parser.add_argument("--namespace", default="", help="namespace of the head (default: none)")
    parser.add_argument(
        "--topics",
        nargs="+",
        choices=tuple(TOPICS),
        metavar="TOPIC",
        help=f"record only these, of {', '.join(TOPICS)}. edge_metric_node measures vergence/edge and vergence/error "
        "only while something subscribes to one of them: leave them out to spare its CPU",
    )
    parser.add_argument(
        "--wait", type=_positive, default=10.0, metavar="S", help="longest wait for the first message (default: 10)"
    )


def run(options: argparse.Namespace) -> int:
    """Record until the duration is over or Ctrl-C; 0, or 1 if nothing came."""
    stop_asked = threading.Event()
    init(signal_handler_options=SignalHandlerOptions.NO)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop_asked.set())
    try:
        node = Node("vergence_record", namespace=checked_namespace(options.namespace))
        try:
            with BagWriter(options.bag, message_definitions("vergence_msgs")) as writer:
                recording = Recording(node, writer, options.topics or tuple(TOPICS))
                recording.run(stop_asked, options.duration, options.wait)
        finally:
            node.destroy_node()
    except GraphError as error:
        print(f"vergence record: {error}", file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    _print_counts(options.bag, writer.counts, recording.duration_s)
    return 0


class Recording:
    """Subscribes the topics of a head and writes what arrives; a topic is in the bag from its first message on.

    Arrivals are in the graph's time: that of /clock where something publishes it, as stamps are.
    """

    def __init__(self, node: Node, writer: BagWriter, topics: tuple[str, ...]) -> None:
        self._node, self._writer = node, writer
        self.clock_ns: int | None = None
        """The time of /clock, None before its first message."""
        self._first_ns = self._last_ns = 0
        self._topics = topics
        node.create_subscription(Clock, "/clock", self._on_clock, QoSProfile(depth=1, reliability=_BEST_EFFORT))
        for topic in topics:
            kind, latched = TOPICS[topic], topic in LATCHED
            qos = QoSProfile(depth=_DEPTH, reliability=_BEST_EFFORT if topic.endswith("camera_info") else _RELIABLE)
            if latched:
                qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
            name = node.resolve_topic_name(topic)
            write = partial(self._write, name, kind, latched)
            node.create_subscription(_message_class(kind), topic, write, qos, raw=True)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last message so far."""
        return (self._last_ns - self._first_ns) * 1e-9

    def run(self, stop_asked: threading.Event, duration_s: float | None, wait_s: float) -> None:
        """Record until the event is set or the time is over. Raises GraphError where nothing comes within `wait_s`."""
        executor = SingleThreadedExecutor(context=self._node.context)
        executor.add_node(self._node)
        wait_until_s = time.monotonic() + wait_s
        try:
            while not stop_asked.is_set():
                executor.spin_once(timeout_sec=_SLICE_S)
                if duration_s is not None and self.duration_s >= duration_s:
                    return
                if not self._writer.counts and time.monotonic() > wait_until_s:
                    raise GraphError(
                        f"none of the head's topics has a message after {wait_s:g} s: is it running, with the same "
                        "ROS_DOMAIN_ID and namespace?"
                    )
        finally:
            executor.shutdown()

    def _on_clock(self, message: Clock) -> None:
        self.clock_ns = to_nanoseconds(message.clock)

    def _write(self, topic: str, kind: str, latched: bool, data: bytes) -> None:
        now_ns = time.time_ns() if self.clock_ns is None else self.clock_ns
        if not self._writer.counts:
            self._first_ns = now_ns
        self._last_ns = now_ns
        if topic not in self._writer.counts:
            self._writer.add(topic, kind, latched)
        self._writer.write_cdr(topic, now_ns, data)


def message_definitions(package: str) -> dict[str, str]:
    """Return the texts of a package's messages by type."""
    folder = Path(get_package_share_directory(package)) / "msg"
    return {f"{package}/msg/{path.stem}": path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.msg"))}


def _message_class(kind: str) -> Any:
    package, _, name = kind.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def _print_counts(bag: Path, counts: Mapping[str, int], duration_s: float) -> None:
    print(f"{bag}: {sum(counts.values())} messages in {duration_s:.1f} s")
    for topic, count in counts.items():
        print(f"{count:>8}  {topic}")
    missing = [side for side in SIDES if not any(f"{side}/image_raw" in topic for topic in counts)]
    if missing:
        print(f"no pictures of the {' and the '.join(missing)} eye: nothing published image_raw/compressed there")


def _positive(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be more than 0: got {text}")
    return value
