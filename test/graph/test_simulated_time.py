"""Simulated time in a graph: /clock waits for the nodes that follow it, names one that has died, and can be stepped."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, JointState

from vergence_common.parameters import ParameterSet
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_nanoseconds, to_stamp
from vergence_msgs.msg import GazeState, TargetTrack
from vergence_rig.rig import default_rig
from vergence_sim.optics import Lens
from vergence_sim.parameters import NODE_GROUPS, SimParameters
from vergence_sim.ros.world_node import WorldNode
from vergence_sim.world import EYES

pytestmark = pytest.mark.graph

STEP_NS = 20_000_000
BEGIN_NS = 100_000_000_000


class Blank:
    """A world without a picture: it notes what it is commanded."""

    def __init__(self) -> None:
        self.parameters = SimParameters.of({"camera.frame_rate_hz": 20.0, "camera.frame_jitter_s": 0.0})
        self.time_s = 0.0
        self.lenses = {eye: Lens(default_rig().left_camera) for eye in EYES}
        self.calibrations = {eye: default_rig().left_camera for eye in EYES}
        self.commands: list[tuple[float, float]] = []

    def set_parameters(self, parameters: SimParameters) -> None:
        self.parameters = parameters

    def command(self, angles_rad: Mapping[str, float], now_s: float | None = None) -> None:
        assert now_s is not None
        self.commands.append((now_s, angles_rad["tilt"]))

    def advance_to(self, time_s: float) -> None:
        self.time_s = max(self.time_s, time_s)

    def expose(self, eye: str) -> Callable[[], Any]:
        return lambda: np.zeros((8, 8, 3), np.uint8)

    def joint_states(self) -> dict[str, float]:
        return {"tilt": 0.0}

    def true_joints(self) -> dict[str, float]:
        return {"tilt": 0.0}

    def close(self) -> None:
        pass


class BlankNode(WorldNode):
    """The simulator's node with a blank world."""

    def __init__(self, **options: Any) -> None:
        self.world = Blank()
        super().__init__("sim_node", NODE_GROUPS, **options)

    def _prepare(self, settings: ParameterSet) -> None:
        pass

    def _make_world(self) -> Blank:
        return self.world

    def _sim_parameters(self, settings: ParameterSet) -> SimParameters:
        return self.world.parameters

    def _publish_truth(self, stamp: Any, world: Any) -> None:
        pass


class Followers(Node):
    """Stands in for controller and metric: answers every tick of a 50 Hz timer and every left image until it dies."""

    def __init__(self, context: Context) -> None:
        super().__init__("followers", context=context, parameter_overrides=[Parameter("use_sim_time", value=True)])
        self.alive = True
        self.cycles_ns: list[int] = []
        self.images_ns: list[int] = []
        self._state = self.create_publisher(GazeState, "gaze/state", 10)
        self._command = self.create_publisher(JointState, "joint_command", 10)
        self._track = self.create_publisher(TargetTrack, "vergence/track", 10)
        self.create_subscription(Image, "left/image_raw", self._on_image, IMAGE_QOS)
        self.create_timer(0.02, self._cycle)

    def _cycle(self) -> None:
        if self.alive:
            now_ns = self.get_clock().now().nanoseconds
            self.cycles_ns.append(now_ns)
            self._command.publish(JointState(name=["tilt"], position=[now_ns * 1e-12]))
            self._state.publish(GazeState(cycle_stamp=self.get_clock().now().to_msg()))

    def _on_image(self, message: Image) -> None:
        self.images_ns.append(to_nanoseconds(message.header.stamp))
        track = TargetTrack()
        track.header.stamp = message.header.stamp
        self._track.publish(track)


class Ticks(Node):
    """Notes every /clock."""

    def __init__(self, context: Context) -> None:
        super().__init__("ticks", context=context)
        self.ns: list[int] = []
        self.create_subscription(Clock, "/clock", lambda message: self.ns.append(to_nanoseconds(message.clock)), 100)


def start(graph: Any, **values: Any) -> tuple[BlankNode, Followers, Ticks]:
    ticks, followers = graph.add(Ticks(graph.context)), graph.add(Followers(graph.context))
    node = graph.start(BlankNode, use_sim_time=True, **values)
    return node, followers, ticks


def test_time_waits_for_every_cycle_and_commands_arrive_after_their_latency(graph: Any) -> None:
    node, followers, ticks = start(graph, **{"clock.real_time_factor": 0.0})

    def every_cycle() -> bool:
        """True once the last forty ticks were a cycle each: before it is known, time runs ahead of a node."""
        return len(followers.cycles_ns) > 40 and bool((np.diff(followers.cycles_ns[-40:]) == STEP_NS).all())

    graph.wait_until(every_cycle, "time to wait for every cycle")
    assert (np.diff(ticks.ns) >= 0).all()
    assert set(np.diff(ticks.ns[-40:])) <= {0, STEP_NS}
    # None is left out.
    assert np.diff(followers.images_ns[-10:]) == pytest.approx(50e6, abs=1)
    begin_s = followers.cycles_ns[-40] * 1e-9
    sent = [(BEGIN_NS * 1e-9 + now_s, angle * 1e3) for now_s, angle in node.world.commands]
    lately = [(arrived_s, cycle_s) for arrived_s, cycle_s in sent if cycle_s > begin_s]
    assert len(lately) > 30
    for arrived_s, cycle_s in lately:
        assert arrived_s == pytest.approx(cycle_s + 0.002, abs=1e-6)


def test_time_is_no_faster_than_real(graph: Any) -> None:
    _, followers, _ = start(graph)
    status = graph.diagnostic(": clock", lambda s: "runs at" in s.message and len(followers.cycles_ns) > 50)
    factor = next(float(value.value) for value in status.values if value.key == "real_time_factor")
    assert 0.0 < factor <= 1.05


def test_one_who_dies_is_named_and_time_goes_on_until_it_is_back(graph: Any) -> None:
    _, followers, ticks = start(graph, **{"clock.timeout_s": 0.3})
    graph.diagnostic(": clock", lambda s: any(v.key == "followed" and "gaze/state" in v.value for v in s.values))
    seen = len(followers.cycles_ns)
    graph.wait_until(lambda: len(followers.cycles_ns) > seen + 20, "twenty cycles that are followed")
    followers.alive = False
    status = graph.diagnostic(": clock", lambda s: s.level != b"\x00")
    assert "gaze/state" in status.message
    assert "vergence/track" not in status.message
    seen = len(ticks.ns)
    graph.wait_until(lambda: len(ticks.ns) > seen + 10, "time to go on")
    followers.alive = True
    graph.diagnostic(": clock", lambda s: s.level == b"\x00" and "runs at" in s.message)


def test_stepped_time_stands_where_it_is_told_and_everything_has_arrived_there(graph: Any) -> None:
    _, followers, ticks = start(graph, **{"clock.stepped": True, "clock.real_time_factor": 0.0})
    run_until = graph.client.create_publisher(Clock, "sim/run_until", 10)
    stands: list[int] = []
    graph.client.create_subscription(
        Clock, "sim/stands_at", lambda message: stands.append(to_nanoseconds(message.clock)), 10
    )
    graph.wait_until(run_until.get_subscription_count, "sim_node to subscribe")

    def answered() -> bool:
        run_until.publish(Clock())
        return bool(stands)

    graph.wait_until(answered, "sim_node to say where it stands")
    graph.wait_until(lambda: bool(ticks.ns), "the time at the start")
    assert set(ticks.ns) == {BEGIN_NS}
    for number in range(1, 30):
        run_until.publish(Clock(clock=to_stamp((BEGIN_NS + number * STEP_NS) * 1e-9)))
        graph.wait_until(lambda number=number: stands[-1] == BEGIN_NS + number * STEP_NS, "it to stand")
        if number > 5:
            assert followers.cycles_ns[-1] == stands[-1]
    assert max(ticks.ns) == stands[-1]
    status = graph.diagnostic(": clock", lambda s: "stands at" in s.message)
    assert status.level == b"\x00"
