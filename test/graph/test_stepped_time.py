"""The demo's simulated time: it passes only while the demo waits, in steps, and its limits count simulated time."""

import itertools
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from rclpy.context import Context
from rclpy.node import Node
from rosgraph_msgs.msg import Clock

from vergence_bringup.demo.ros import timeline
from vergence_bringup.demo.ros.timeline import SteppedTime
from vergence_bringup.graph_errors import GraphError, ProcessError
from vergence_common.stamps import from_nanoseconds, to_nanoseconds

pytestmark = pytest.mark.graph

STEP_NS = 20_000_000


class Simulator(Node):
    """Stands in for sim_node: runs at once to where it is told, and says so."""

    def __init__(self, context: Context) -> None:
        super().__init__("sim_node", context=context)
        self.now_ns = 100_300_000_000
        self.asked_ns: list[int] = []
        self._stands = self.create_publisher(Clock, "sim/stands_at", 10)
        self._outputs = [self.create_publisher(Clock, topic, 10) for topic in timeline._OUTPUTS]
        self.create_subscription(Clock, "sim/run_until", self._on_run_until, 10)

    def _on_run_until(self, message: Clock) -> None:
        self.asked_ns.append(to_nanoseconds(message.clock))
        self.now_ns = max(self.now_ns, self.asked_ns[-1])
        self._stands.publish(Clock(clock=from_nanoseconds(self.now_ns)))


class Demo:
    """Steps the simulator from a thread of its own, while the test spins."""

    def __init__(self, graph: Any) -> None:
        self._graph = graph
        self.simulator: Simulator = graph.add(Simulator(graph.context))
        self.time = SteppedTime(graph.client, threading.Condition())
        self._pool = ThreadPoolExecutor(1)

    def do(self, work: Callable[..., Any], *arguments: Any) -> Any:
        """Return what `work` returns; it runs in the demo's thread."""
        future = self._pool.submit(work, *arguments, self.check)
        self._graph.wait_until(future.done, "the demo to go on")
        return future.result()

    def check(self) -> None:
        """No process has ended."""

    def close(self) -> None:
        self._pool.shutdown()


@pytest.fixture
def demo(graph: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Demo]:
    monkeypatch.setattr(timeline, "_DISCOVERY_S", 0.0)
    demo = Demo(graph)
    demo.do(demo.time.begin)
    yield demo
    demo.close()


def test_it_begins_on_a_full_second_and_passes_in_steps(demo: Demo) -> None:
    assert demo.time.now_s() == pytest.approx(101.0)
    before = len(demo.simulator.asked_ns)
    demo.do(demo.time.settle, 0.1)
    assert demo.time.now_s() == pytest.approx(101.1)
    steps = {late_ns - early_ns for early_ns, late_ns in itertools.pairwise(demo.simulator.asked_ns[before:])}
    assert steps <= {0, STEP_NS}
    demo.do(demo.time.align)
    assert demo.time.now_s() == pytest.approx(102.0)
    assert demo.time.figures()["simulated_s"] == pytest.approx(1.7)


def test_a_condition_is_awaited_where_time_stands_and_no_step_longer(demo: Demo) -> None:
    answer = demo.do(demo.time.wait_for, "a moment", lambda: demo.simulator.now_ns >= 101_050_000_000, 1.0)
    assert answer is True
    assert demo.time.now_s() == pytest.approx(101.06)
    assert demo.do(demo.time.wait_for, "nothing", lambda: "here", 1.0) == "here"
    assert demo.simulator.now_ns == 101_060_000_000


def test_a_limit_counts_simulated_time(demo: Demo) -> None:
    with pytest.raises(GraphError, match=r"0\.5 s of simulated time waiting for the moon"):
        demo.do(demo.time.wait_for, "the moon", lambda: None, 0.5)
    assert demo.time.now_s() == pytest.approx(101.5)


def test_after_a_goal_it_goes_on_at_one_time_however_late_the_result_came(demo: Demo) -> None:
    demo.do(demo.time.settle, 0.06)
    demo.do(demo.time.settle_after_goal, 101.02)
    assert demo.time.now_s() == pytest.approx(101.22)
    demo.do(demo.time.settle_after_goal, 101.0)
    assert demo.time.now_s() == pytest.approx(101.22)


def test_a_process_that_has_ended_ends_the_wait(demo: Demo) -> None:
    def check() -> None:
        raise ProcessError("sim_node ended with status 1")

    demo.check = check  # type: ignore[method-assign]
    with pytest.raises(ProcessError, match="status 1"):
        demo.do(demo.time.settle, 100.0)
