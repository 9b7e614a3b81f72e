"""A goal of kind MOTION through the running nodes: the eyes wait for what moves next, and verge on it."""

import math
from typing import Any

import pytest
from rclpy.action import ActionClient
from rosgraph_msgs.msg import Clock

from vergence_common.stamps import from_nanoseconds, to_nanoseconds
from vergence_gaze.ros.gaze_controller_node import GazeControllerNode
from vergence_metric.ros.edge_metric_node import EdgeMetricNode
from vergence_msgs.action import LookAt
from vergence_msgs.msg import TargetTrack, TrueVergence
from vergence_sim.ros.sim_node import SimNode

pytestmark = [pytest.mark.graph, pytest.mark.usefixtures("opengl")]

STEP_NS = 100_000_000
WAIT_STEPS, MOST_STEPS = 10, 60
CUBE_DEG = 2.0  # half of its width; beside it is the room


class SteppedGraph:
    """Simulator, metric and controller in one process, in simulated time that passes only in steps."""

    def __init__(self, graph: Any) -> None:
        graph.timeout_s = 120.0
        self.graph = graph
        self.sim: SimNode = graph.start(
            SimNode,
            use_sim_time=True,
            **{
                "clock.stepped": True,
                "clock.real_time_factor": 0.0,
                "clock.timeout_s": 60.0,
                "head.model": "ideal",
                "servo": "rig",
                "target.y_m": 0.1,
            },
        )
        graph.start(EdgeMetricNode, use_sim_time=True)
        graph.start(GazeControllerNode, use_sim_time=True)
        self.truth: list[TrueVergence] = []
        self.tracks: list[TargetTrack] = []
        self._stands_ns: list[int] = []
        client = graph.client
        client.create_subscription(TrueVergence, "ground_truth/vergence", self.truth.append, 10)
        client.create_subscription(TargetTrack, "vergence/track", self.tracks.append, 10)
        client.create_subscription(Clock, "sim/stands_at", self._on_stand, 10)
        self._run_until = client.create_publisher(Clock, "sim/run_until", 10)
        for topic in ("vergence/track", "gaze/state"):
            graph.wait_until(lambda topic=topic: client.count_publishers(topic) > 0, f"a publisher of {topic}")
        graph.wait_until(self._run_until.get_subscription_count, "sim_node to subscribe")
        self._run_to(0)

    def step(self) -> None:
        """Let a step of simulated time pass."""
        self._run_to(self._stands_ns[-1] + STEP_NS)

    def _run_to(self, time_ns: int) -> None:
        before = len(self._stands_ns)
        self._run_until.publish(Clock(clock=from_nanoseconds(time_ns)))
        self.graph.wait_until(lambda: len(self._stands_ns) > before, "simulated time to stand")

    def _on_stand(self, message: Clock) -> None:
        self._stands_ns.append(to_nanoseconds(message.clock))


def test_the_eyes_wait_for_what_moves_and_verge_on_it(graph: Any) -> None:
    stepped = SteppedGraph(graph)
    for _ in range(4):
        stepped.step()
    look_at = ActionClient(graph.client, LookAt, "gaze/look_at")
    graph.wait_until(look_at.server_is_ready, "the action server is there")
    goal = graph.wait(look_at.send_goal_async(LookAt.Goal(kind=LookAt.Goal.MOTION)))
    assert goal.accepted
    result = goal.get_result_async()
    for _ in range(WAIT_STEPS):
        stepped.step()
    assert not result.done()
    assert "waiting for something that moves" in stepped.tracks[-1].reason
    last = stepped.truth[-1]
    assert max(abs(angle) for angle in (last.pan_left_rad, last.pan_right_rad, last.tilt_rad)) < 0.02
    moving = {"motion.kind": "sinusoid", "motion.y_m": -0.12, "motion.frequency_hz": 0.15}
    assert graph.set_parameters(stepped.sim, **moving).successful
    for _ in range(MOST_STEPS):
        if result.done():
            break
        stepped.step()
    assert graph.wait(result).result.result == LookAt.Result.VERGED
    assert math.degrees(stepped.truth[-1].left_error_rad) < CUBE_DEG
