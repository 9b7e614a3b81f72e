"""Callbacks run, other threads run beside them, and a shutdown ends the spinning, on whichever executor is chosen."""

import threading
from collections.abc import Iterator

import pytest
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from vergence_common.executor import VARIABLE, make_executor, spin

WAIT_S = 20.0


@pytest.fixture(params=["events", "single"])
def context(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Context]:
    monkeypatch.setenv(VARIABLE, request.param)
    context = Context()
    rclpy.init(args=[], context=context)
    yield context
    context.try_shutdown()


def test_timers_run_beside_other_threads_until_the_shutdown(context: Context) -> None:
    executor, node = make_executor(context), Node("node", context=context)
    called = {kind: threading.Event() for kind in (ClockType.ROS_TIME, ClockType.STEADY_TIME)}
    for kind, event in called.items():
        node.create_timer(0.01, event.set, clock=Clock(clock_type=kind))
    executor.add_node(node)
    seen: list[bool] = []

    def end() -> None:
        seen.extend(event.wait(WAIT_S) for event in called.values())
        context.try_shutdown()

    watcher = threading.Thread(target=end)
    watcher.start()
    spin(executor, context)
    watcher.join()
    assert seen == [True, True]
    node.destroy_node()


def test_the_executor_can_be_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "single")
    context = Context()
    rclpy.init(args=[], context=context)
    assert isinstance(make_executor(context), SingleThreadedExecutor)
    context.try_shutdown()
