"""gaze_controller_node's cycle in simulated time, where every tick of the clock must be answered once."""

import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from vergence_common.qos import STATE_QOS
from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_msgs.msg import GazeState

from .conftest import Graph

pytestmark = pytest.mark.graph

START_NS, PERIOD_NS = 100_000_000_000, 20_000_000


def test_a_timer_that_is_called_twice_at_one_moment_leaves_out_no_cycle(graph: Graph) -> None:
    node = graph.start(GazeControllerNode, use_sim_time=True)
    clock = graph.client.create_publisher(Clock, "/clock", QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE))
    cycles_ns: list[int] = []
    graph.client.create_subscription(
        GazeState, "gaze/state", lambda state: cycles_ns.append(to_nanoseconds(state.cycle_stamp)), STATE_QOS
    )
    graph.wait_until(lambda: clock.get_subscription_count() == 1, "the controller's subscription of /clock")
    graph.wait_until(lambda: node._state.get_subscription_count() == 1, "the controller's subscriber")
    now_ns = START_NS

    def tick() -> None:
        nonlocal now_ns
        now_ns += PERIOD_NS
        clock.publish(Clock(clock=from_nanoseconds(now_ns)))
        graph.wait_until(lambda: cycles_ns[-1:] == [now_ns], f"the cycle at {now_ns} ns")

    tick()
    tick()
    # What rclpy's events executor does now and then, where another timer begins or ends at the moment of this one.
    node._cycle_timer.timer.handle.call_timer()
    node._cycle_timer.timer.callback()
    for _ in range(3):
        tick()
    assert len(cycles_ns) == len(set(cycles_ns)) == 5
