"""Real processes: one publisher per eye, 640x480 bgr8 at 30 Hz, edge_metric_node with the shipped YAML, and a receiver.

Latency is from just before the publication of the pair's later image to the arrival of its `vergence/edge` in this
process. `.skewed`: the right eye is 11 ms later than the left one, as free-running cameras are.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from bench.harness import Row
from vergence_bringup.processes import NodeCommand, ProcessGroup
from vergence_common.domains import own_domain
from vergence_common.qos import STATE_QOS
from vergence_common.stamps import to_nanoseconds
from vergence_msgs.msg import EdgeVergence

PERIOD_NS = round(1e9 / 30)
SKEW_NS = 11_000_000
_PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"


@dataclass(frozen=True)
class Outcome:
    """What one run gave: the share of pairs that came back, and each pair's latency [ms]."""

    delivered: float
    latency_ms: "np.ndarray"
    stages: dict[str, str]


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure with the shipped transport profile and with the default one; equal stamps and skewed."""
    rows = []
    for name, skew_ns, seconds, default_seconds in (("", 0, 60, 25), (".skewed", SKEW_NS, 30, 15)):
        apart = "equal stamps" if not skew_ns else f"{skew_ns / 1e6:.0f} ms apart"
        say(f"{apart}: {seconds} s, then the default profile")
        ours = measure(skew_ns, seconds, shipped_profile=True)
        for stage, value in ours.stages.items():
            say(f"  {stage}: {value}")
        default = measure(skew_ns, default_seconds, shipped_profile=False)
        peer = "default transport profile"
        rows += [
            Row(f"graph.pairs_delivered{name}", ours.delivered, "share", peer, default.delivered),
            Row(f"graph.latency_median_ms{name}", _percentile(ours, 50), "ms", peer, _percentile(default, 50)),
            Row(f"graph.latency_p99_ms{name}", _percentile(ours, 99), "ms", peer, _percentile(default, 99)),
        ]
    return rows


def _percentile(outcome: Outcome, percent: float) -> float:
    return float(np.percentile(outcome.latency_ms, percent)) if outcome.latency_ms.size else float("nan")


def measure(skew_ns: int, seconds: float, shipped_profile: bool) -> Outcome:
    """Run the graph once."""
    with own_domain() as domain:
        extra = {"ROS_DOMAIN_ID": str(domain)}
        kept = {name: os.environ.pop(name) for name in (_PROFILE,) if not shipped_profile and name in os.environ}
        try:
            environment = os.environ | extra | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
            with ProcessGroup(extra_environment=extra if shipped_profile else extra | {_PROFILE: ""}) as nodes:
                nodes.start("edge_metric_node", NodeCommand("vergence_metric", "edge_metric_node"))
                return _run_eyes(domain, environment, skew_ns, seconds)
        finally:
            os.environ.update(kept)


def _run_eyes(domain: int, environment: dict[str, str], skew_ns: int, seconds: float) -> Outcome:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node("graph_bench", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    arrived: dict[int, int] = {}
    stages: dict[str, str] = {}

    def on_edge(message: EdgeVergence) -> None:
        arrived[to_nanoseconds(message.header.stamp)] = time.monotonic_ns()

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "edge_metric_node: measurement":
                stages.update((pair.key, pair.value) for pair in status.values)

    node.create_subscription(EdgeVergence, "vergence/edge", on_edge, STATE_QOS)
    node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 10)
    eyes = [
        subprocess.Popen(
            [sys.executable, "-m", "bench.eye_publisher", topic, str(shift_px)],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for topic, shift_px in (("left/image_raw", 0), ("right/image_raw", 12))
    ]
    try:
        for eye in eyes:
            assert eye.stdout is not None
            if eye.stdout.readline().strip() != "ready":
                raise RuntimeError(f"an eye ended with status {eye.wait()}")
        count, start_ns = round(seconds * 30), time.monotonic_ns() + 1_000_000_000
        for eye, offset_ns in zip(eyes, (0, skew_ns), strict=True):
            timetable = {"start_ns": start_ns, "period_ns": PERIOD_NS, "offset_ns": offset_ns, "count": count}
            _tell(eye, json.dumps(timetable))
        end_ns = start_ns + count * PERIOD_NS + 1_000_000_000
        while time.monotonic_ns() < end_ns:
            executor.spin_once(timeout_sec=0.1)
        sent = [dict(json.loads(eye.stdout.readline())) for eye in eyes if eye.stdout is not None]
        for eye in eyes:
            _tell(eye, "")
            eye.wait(10)
    finally:
        for eye in eyes:
            eye.kill()
            eye.wait()
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    later_ns = {stamp: max(published, sent[1][stamp + skew_ns]) for stamp, published in sent[0].items()}
    latency = [arrived[stamp] - later_ns[stamp] for stamp in later_ns if stamp in arrived]
    return Outcome(len(latency) / len(later_ns), np.array(latency) * 1e-6, stages)


def _tell(eye: "subprocess.Popen[str]", line: str) -> None:
    assert eye.stdin is not None
    eye.stdin.write(line + "\n")
    eye.stdin.flush()
