"""Rates of both metrics in the whole graph of the simulated head, every node as a process on this machine."""

import time
from collections.abc import Callable

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from vergence_bringup.node_table import SIMULATED, graph
from vergence_bringup.ros.processes import NodeCommand, ProcessGroup
from vergence_common.domains import own_domain
from vergence_common.qos import STATE_QOS
from vergence_msgs.msg import BoxVergence, EdgeVergence

READY_WITHIN_S = 90.0
SETTLED_S = 5.0
COUNTED_S = 25.0


def measure_rates(say: Callable[[str], None]) -> tuple[float, float]:
    """Return the rates [Hz] of box_metric_node and edge_metric_node, with the shipped YAML."""
    with own_domain() as domain, ProcessGroup(extra_environment={"ROS_DOMAIN_ID": str(domain)}) as nodes:
        for executable in graph(SIMULATED):
            nodes.start(executable, NodeCommand.of(executable))
        counts, statuses = _count(domain)
    say(f"statuses of metric II: {statuses}")
    return counts["box"] / COUNTED_S, counts["edge"] / COUNTED_S


def _count(domain: int) -> tuple[dict[str, int], dict[int, int]]:
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    node = Node("box_bench", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    counts = {"box": 0, "edge": 0}
    statuses: dict[int, int] = {}

    def on_box(message: BoxVergence) -> None:
        counts["box"] += 1
        statuses[message.status] = statuses.get(message.status, 0) + 1

    def on_edge(_: EdgeVergence) -> None:
        counts["edge"] += 1

    node.create_subscription(BoxVergence, "vergence/box", on_box, STATE_QOS)
    node.create_subscription(EdgeVergence, "vergence/edge", on_edge, STATE_QOS)
    try:
        started_s = time.monotonic()
        while not (counts["box"] and counts["edge"]):
            if time.monotonic() - started_s > READY_WITHIN_S:
                raise RuntimeError(f"no {'box' if counts['edge'] else 'edge'} metric within {READY_WITHIN_S:g} s")
            executor.spin_once(timeout_sec=0.1)
        _spin(executor, SETTLED_S)
        counts.update(box=0, edge=0)
        statuses.clear()
        _spin(executor, COUNTED_S)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    return counts, statuses


def _spin(executor: SingleThreadedExecutor, seconds: float) -> None:
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        executor.spin_once(timeout_sec=0.1)
