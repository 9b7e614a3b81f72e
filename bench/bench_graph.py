"""Real processes: one publisher per eye, 640x480 bgr8 at 30 Hz, edge_metric_node with the shipped YAML, and a receiver.

Latency is from just before the publication of the pair's later image to the arrival of its `vergence/edge` in this
process. `.skewed`: the right eye is 11 ms later than the left one, as free-running cameras are.
"""

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from bench.results import OUT_DIR, Row
from vergence_bringup.ros.processes import NodeCommand, ProcessGroup
from vergence_common.domains import own_domain
from vergence_common.qos import STATE_QOS
from vergence_common.stamps import to_nanoseconds
from vergence_msgs.msg import EdgeVergence

PERIOD_NS = round(1e9 / 30)
SKEW_NS = 11_000_000
DISPARITY_PX = 12


@dataclass(frozen=True)
class Outcome:
    """One run: the share of pairs whose metric arrived, and each pair's latency [ms]."""

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
        medians = {n: float(v) for n, v in ours.stages.items() if n.endswith("_median_ms")}
        say("  medians [ms]: " + ", ".join(f"{n.removesuffix('_median_ms')} {v:.2f}" for n, v in medians.items()))
        say(f"  {ours.stages['measured']} pairs measured, {ours.stages['dropped']} left out")
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
        environment = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        if not shipped_profile:
            environment["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(_empty_profile())
        with ProcessGroup(OUT_DIR / "graph_logs", environment) as nodes:
            nodes.start("edge_metric_node", NodeCommand.of("edge_metric_node"))
            with _receiver(domain) as receiver, _eyes(os.environ | environment) as eyes:
                deadline_s = time.monotonic() + 60.0
                while not (receiver.is_matched() and all(eye.is_ready() for eye in eyes)):
                    nodes.check()
                    if time.monotonic() > deadline_s:
                        raise RuntimeError("the processes did not discover one another within 60 s")
                return _timed_run(eyes, receiver, skew_ns, seconds)


def _empty_profile() -> Path:
    """Return the path of an empty profile: where none is set, ProcessGroup sets the shipped one."""
    path = OUT_DIR / "default_transport.xml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text('<profiles>\n  <participant profile_name="as_built"/>\n</profiles>\n')
    return path


class Eye:
    """A `bench.graph_eye_publisher` process and its pipes."""

    def __init__(self, topic: str, shift_px: int, environment: dict[str, str]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "bench.graph_eye_publisher", topic, str(shift_px)],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._to, self._from = self._process.stdin, self._process.stdout
        self._ready = False

    def is_ready(self) -> bool:
        """Return whether the eye has been matched with the node; waits up to 0.1 s."""
        if not self._ready and select.select([self._from], [], [], 0.1)[0]:
            line = self._from.readline()
            if not line:
                raise RuntimeError(f"graph_eye_publisher ended with status {self._process.wait()}")
            self._ready = line.strip() == "ready"
        return self._ready

    def start(self, **timetable: int) -> None:
        """Start publishing; see `bench.graph_eye_publisher`."""
        print(json.dumps(timetable), file=self._to, flush=True)

    def published_ns(self) -> dict[int, int]:
        """Wait for the last image, return each stamp's time of publication [ns], and let the eye exit."""
        sent = dict(json.loads(self._from.readline()))
        print(file=self._to, flush=True)
        return sent

    def end(self) -> None:
        """Close its input, so that it exits; a killed process may crash those that share memory with it."""
        self._to.close()
        try:
            self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


@contextmanager
def _eyes(environment: dict[str, str]) -> Iterator[list[Eye]]:
    eyes = [Eye("left/image_raw", 0, environment), Eye("right/image_raw", DISPARITY_PX, environment)]
    try:
        yield eyes
    finally:
        for eye in eyes:
            eye.end()


def _timed_run(eyes: list[Eye], receiver: "Receiver", skew_ns: int, seconds: float) -> Outcome:
    count, start_ns = round(seconds * 30), time.monotonic_ns() + 1_000_000_000
    for eye, offset_ns in zip(eyes, (0, skew_ns), strict=True):
        eye.start(start_ns=start_ns, period_ns=PERIOD_NS, offset_ns=offset_ns, count=count)
    receiver.spin_until(start_ns + count * PERIOD_NS + 1_000_000_000)
    left, right = (eye.published_ns() for eye in eyes)
    later_ns = {stamp: max(published, right[stamp + skew_ns]) for stamp, published in left.items()}
    latency = [receiver.arrived_ns[stamp] - later_ns[stamp] for stamp in later_ns if stamp in receiver.arrived_ns]
    return Outcome(len(latency) / len(later_ns), np.array(latency) * 1e-6, receiver.stages)


class Receiver:
    """Records the arrival of each pair's `vergence/edge`, and the node's own timings."""

    def __init__(self, context: Context) -> None:
        self.arrived_ns: dict[int, int] = {}
        self.stages: dict[str, str] = {}
        self.node = Node("graph_bench", context=context)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self.node.create_subscription(EdgeVergence, "vergence/edge", self._on_edge, STATE_QOS)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def _on_edge(self, message: EdgeVergence) -> None:
        self.arrived_ns[to_nanoseconds(message.header.stamp)] = time.monotonic_ns()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "edge_metric_node: measurement":
                self.stages.update((pair.key, pair.value) for pair in status.values)

    def is_matched(self) -> bool:
        """Receive for 0.2 s; True once diagnostics of the node arrive: discovery is complete."""
        self.executor.spin_once(timeout_sec=0.2)
        return bool(self.stages)

    def spin_until(self, end_ns: int) -> None:
        """Receive until a monotonic time."""
        while time.monotonic_ns() < end_ns:
            self.executor.spin_once(timeout_sec=0.1)


@contextmanager
def _receiver(domain: int) -> Iterator[Receiver]:
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    receiver = Receiver(context)
    try:
        yield receiver
    finally:
        receiver.executor.shutdown()
        receiver.node.destroy_node()
        context.try_shutdown()
