"""`make soak`: a simulated head looks at a target that is moved every five seconds, for an hour or DURATION_S seconds.

The duration is of the wall clock. The goals' periods are of simulated time, which waits for the nodes: whether a goal
succeeds does not depend on what else the machine does. Memory, threads and descriptors of every node are sampled; what
is left in shared memory is counted at the end.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PointStamped
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from bench import results
from bench.process_cost import rss_mb
from bench.results import Row
from vergence_bringup.ros.processes import ProcessGroup, config_dir
from vergence_bringup.ros.simulated_head import simulated_head
from vergence_common.domains import own_domain
from vergence_common.goal_requests import request_goal, request_result
from vergence_msgs.action import LookAt

DURATION_S, PERIOD_S, SAMPLE_S = 3600.0, 5.0, 10.0
_WARM_SHARE = 0.25  # of the duration: caches fill, and count for no slope
_START_S, _STALLED_S = 60.0, 120.0
# Cameras half a period apart pair only when a later image has come, and simulated time then waits for every pair: with
# this drift they come near it within the hour, and not to it.
_WORLD: dict[str, Any] = {"head.model": "ideal", "clock.stepped": False, "right_camera.clock_drift": 4e-6}
_SHM = Path("/dev/shm")


@dataclass
class Samples:
    """Of one process: times [s], memory [MB], numbers of threads and of open files."""

    time_s: list[float] = field(default_factory=list)
    rss_mb: list[float] = field(default_factory=list)
    threads: list[int] = field(default_factory=list)
    descriptors: list[int] = field(default_factory=list)

    def add(self, time_s: float, pid: int) -> None:
        """Look at the process now."""
        self.time_s.append(time_s)
        self.rss_mb.append(rss_mb(pid))
        self.threads.append(len(os.listdir(f"/proc/{pid}/task")))
        self.descriptors.append(len(os.listdir(f"/proc/{pid}/fd")))

    def slope_mb_h(self) -> float:
        """Return the growth of the memory after the warm-up [MB/h]."""
        first = int(_WARM_SHARE * len(self.time_s))
        if len(self.time_s) - first < 2:
            return float("nan")
        return float(np.polyfit(np.array(self.time_s[first:]) / 3600.0, self.rss_mb[first:], 1)[0])

    def gained(self, what: str) -> int:
        """Return how many threads or descriptors the last third has more than the time after the warm-up."""
        values = getattr(self, what)[int(_WARM_SHARE * len(self.time_s)) :]
        third = max(len(values) // 3, 1)
        return int(np.median(values[-third:]) - np.median(values[:third]))


class Goals:
    """Moves the target and looks at it, one goal after the other."""

    def __init__(self, context: Context) -> None:
        self.node = Node("soak", context=context, parameter_overrides=[Parameter("use_sim_time", value=True)])
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self.node)
        self._pose = self.node.create_publisher(PointStamped, "sim/target_pose", 10)
        self._client = ActionClient(self.node, LookAt, "gaze/look_at")
        self._random = np.random.default_rng(0)

    def ready(self) -> bool:
        """Run callbacks; return whether the graph is there."""
        self._executor.spin_once(timeout_sec=0.2)
        return self._client.server_is_ready() and self._pose.get_subscription_count() > 0 and self.now_s() > 0

    def now_s(self) -> float:
        """Return the simulated time [s], 0 before it is known."""
        return float(self.node.get_clock().now().nanoseconds) * 1e-9

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._client.destroy()
        self.node.destroy_node()

    def one(self) -> bool:
        """Look at a new place; return whether the eyes verged on it within the period."""
        end_s = self.now_s() + PERIOD_S
        x, y, z = (float(v) for v in self._random.uniform((0.45, -0.12, -0.06), (0.9, 0.12, 0.06)))
        place = PointStamped()
        place.header.frame_id = "rig_base"
        place.point.x, place.point.y, place.point.z = x, y, z
        self._pose.publish(place)
        goal = LookAt.Goal(kind=LookAt.Goal.POINT, time_limit_s=PERIOD_S - 0.5)
        goal.header.frame_id = "rig_base"
        goal.point.x, goal.point.y, goal.point.z = x, y, z
        sent = request_goal(self.node, self._client, goal)
        self._run(sent.done, end_s)
        verged = False
        if sent.done() and sent.result().accepted:
            ended = request_result(self.node, sent.result())
            self._run(ended.done, end_s)
            verged = ended.done() and ended.result().result.result == LookAt.Result.VERGED
        self._run(lambda: False, end_s)
        return verged

    def _run(self, done: Callable[[], bool], end_s: float) -> None:
        stalled_s = time.monotonic() + _STALLED_S
        while not done() and self.now_s() < end_s:
            self._executor.spin_once(timeout_sec=0.2)
            if time.monotonic() > stalled_s:
                raise RuntimeError(f"simulated time has not come to {end_s:.1f} s within {_STALLED_S:g} s")


def segments(pid: int | str) -> set[Path]:
    """Return the shared-memory segments that a process has mapped: its own, and those of the graph that it reads."""
    lines = Path(f"/proc/{pid}/maps").read_text(encoding="utf-8", errors="replace").splitlines()
    paths = (line.split(maxsplit=5)[5] for line in lines if f"{_SHM}/fast" in line)
    return {Path(path) for path in paths if not path.endswith("(deleted)")}


def run(duration_s: float) -> list[Row]:
    """Run the soak and return its rows."""
    mapped: set[Path] = set()
    # The ports' segments are those of other graphs too, and of nodes that were killed.
    before = set(_SHM.glob("fast*"))
    with own_domain() as domain:
        commands = simulated_head(config_dir() / "rig.yaml", simulated_time=True, **_WORLD)
        with ProcessGroup(results.OUT_DIR / "soak_logs", {"ROS_DOMAIN_ID": str(domain)}) as nodes:
            for name, command in commands.items():
                nodes.start(name, command)
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            context = Context()
            rclpy.init(args=[], context=context, domain_id=domain)
            goals = Goals(context)
            samples, verged = _soak(goals, nodes, {name: nodes.pid(name) for name in commands}, duration_s)
            mapped = segments("self").union(*(segments(nodes.pid(name)) for name in commands))
            goals.close()
            context.try_shutdown()
    left = sum(path.exists() for path in mapped - before)
    for name, of_node in samples.items():
        print(
            f"   {name}: {of_node.rss_mb[0]:.0f} to {of_node.rss_mb[-1]:.0f} MB, {of_node.slope_mb_h():+.1f} MB/h, "
            f"threads {of_node.threads[-1]}, descriptors {of_node.descriptors[-1]}",
            flush=True,
        )
    unit = f"in {duration_s / 3600:.2g} h"
    return [
        Row("soak.success_share", float(np.mean(verged)), f"of {len(verged)} goals"),
        Row("soak.rss_slope_mb_h", max(s.slope_mb_h() for s in samples.values()), f"MB/h, worst node, {unit}"),
        Row("soak.threads_gained", float(max(s.gained("threads") for s in samples.values())), unit),
        Row("soak.descriptors_gained", float(max(s.gained("descriptors") for s in samples.values())), unit),
        Row("soak.segments_left", float(left), "segments in /dev/shm"),
    ]


def _soak(
    goals: Goals, nodes: ProcessGroup, pids: Mapping[str, int], duration_s: float
) -> tuple[dict[str, Samples], list[bool]]:
    started_s = time.monotonic()
    while not goals.ready():
        nodes.check()
        if time.monotonic() - started_s > _START_S:
            raise RuntimeError(f"the graph did not start within {_START_S:g} s")
    samples = {name: Samples() for name in pids}
    verged: list[bool] = []
    sampled_s = -SAMPLE_S
    for now_s in _periods(duration_s):
        nodes.check()
        if now_s - sampled_s >= SAMPLE_S:
            sampled_s = now_s
            for name, pid in pids.items():
                samples[name].add(now_s, pid)
        verged.append(goals.one())
        if len(verged) % 60 == 0:
            print(f"   {now_s:.0f} s: {sum(verged)} of {len(verged)} goals verged", flush=True)
    return samples, verged


def _periods(duration_s: float) -> Iterator[float]:
    """Yield the time since the start until the duration is over."""
    started_s = time.monotonic()
    while (now_s := time.monotonic() - started_s) < duration_s:
        yield now_s


def main() -> int:
    """Run the soak for the seconds that the command line gives, print and write its rows."""
    duration_s = float(sys.argv[1]) if len(sys.argv) > 1 else DURATION_S
    rows = run(duration_s)
    path = results.write("soak", rows)
    print(results.table(rows))
    print(f"   written to {path.relative_to(results.OUT_DIR.parent.parent)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
