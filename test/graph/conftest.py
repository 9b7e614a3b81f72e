"""In-process graphs: real nodes on a domain, context and executor of the test's own, waited for by events."""

import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.task import Future

from vergence_common import diagnostics
from vergence_common.qos import STATE_QOS

AnyNode = TypeVar("AnyNode", bound=Node)


class Graph:
    """Nodes of one test. Waiting spins the executor until a future is done or a condition holds, and fails if not."""

    def __init__(self, context: Context, timeout_s: float = 60.0) -> None:
        self.context = context
        self.timeout_s = timeout_s
        self.executor = SingleThreadedExecutor(context=context)
        self._nodes: list[Node] = []
        self.client = self.add(Node("test_client", context=context))
        """A plain node for the test's own publishers, subscriptions and clients."""

    def start(self, kind: Callable[..., AnyNode], **parameters: Any) -> AnyNode:
        """Make a node of class `kind` with these parameters and spin it whenever the test waits."""
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        return self.add(kind(context=self.context, parameter_overrides=overrides))

    def add(self, node: AnyNode) -> AnyNode:
        """Spin `node` whenever the test waits; it is closed at the test's end."""
        self._nodes.append(node)
        self.executor.add_node(node)
        return node

    def wait(self, future: Future) -> Any:
        """Return the future's result."""
        self.executor.spin_until_future_complete(future, timeout_sec=self.timeout_s)
        assert future.done(), f"nothing came within {self.timeout_s:g} s"
        return future.result()

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        """Spin until `condition()`; it is asked after everything the executor does."""
        end_s = time.monotonic() + self.timeout_s
        while not condition():
            assert time.monotonic() < end_s, f"not within {self.timeout_s:g} s: {what}"
            self.executor.spin_once(timeout_sec=0.05)

    def message(
        self,
        kind: Any,
        topic: str,
        wanted: Callable[[Any], bool] = lambda message: True,
        qos: QoSProfile = STATE_QOS,
    ) -> Future:
        """Return a future of the first message on `topic` for which `wanted(message)`."""
        future = Future(executor=self.executor)

        def receive(message: Any) -> None:
            if not future.done() and wanted(message):
                future.set_result(message)

        self.client.create_subscription(kind, topic, receive, qos)
        return future

    def diagnostic(self, name_end: str, wanted: Callable[[DiagnosticStatus], bool]) -> DiagnosticStatus:
        """Return the first diagnostic status whose name ends so and for which `wanted(status)`."""
        found: list[DiagnosticStatus] = []

        def has(message: DiagnosticArray) -> bool:
            found.extend(s for s in message.status if s.name.endswith(name_end) and wanted(s))
            return bool(found)

        self.wait(self.message(DiagnosticArray, "/diagnostics", has))
        return found[0]

    def set_parameters(self, node: Node, **values: Any) -> Any:
        """Set parameters of `node` all at once; return the SetParametersResult."""
        return node.set_parameters_atomically([Parameter(name, value=value) for name, value in values.items()])

    def close(self) -> None:
        """Close every node, newest first."""
        for node in reversed(self._nodes):
            self.executor.remove_node(node)
            close = getattr(node, "close", None)
            if close is not None:
                close()
            node.destroy_node()
        self.executor.shutdown()


@pytest.fixture(autouse=True)
def quick_diagnostics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten times a second, so that a test that waits for one does not wait long."""
    monkeypatch.setattr(diagnostics, "PERIOD_S", 0.1)


@pytest.fixture
def context(domain_id: int) -> Iterator[Context]:
    """A ROS context of this test's own."""
    own = Context()
    rclpy.init(args=[], context=own, domain_id=domain_id)
    yield own
    own.try_shutdown()


@pytest.fixture
def graph(context: Context) -> Iterator[Graph]:
    """An empty graph of this test's own."""
    graph = Graph(context)
    yield graph
    graph.close()
