"""One run of a graph as processes: each process's share of a core and its memory, over some seconds."""

import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bench.budget_recording import RATE_HZ, calibration_of
from bench.process_cost import cpu_s, end, rss_mb
from bench.results import OUT_DIR
from vergence_bringup.ros.processes import Command, NodeCommand, ProcessGroup, environment, find_node
from vergence_common.domains import own_domain

SETTLED_S = 12.0
IDLE_S = 25.0  # after which a head without a goal measures and receives nothing
MEASURED_S = 15.0
_STARTED_S = 5.0


@dataclass(frozen=True)
class Share:
    """CPU time over wall time of a process, 1.0 being one core, and its resident memory [MB]."""

    core: float
    rss_mb: float


class HeadCommand:
    """The command line of head_node with two cameras that replay a folder of pictures each, and fake servos."""

    def __init__(self, folders: Mapping[str, Path]) -> None:
        self._folders = folders

    def argv(self) -> list[str]:
        """Return the command line."""
        argv = [str(find_node("head_node"))]
        for eye, folder in self._folders.items():
            for name, value in camera_parameters(folder).items():
                argv += ["--set", f"{eye}_camera:{name}:={value}"]
        return [*argv, "--set", "servo_node:backend:=fake"]


def camera_parameters(folder: Path) -> dict[str, object]:
    """Return the parameters of a camera_node that replays a folder of pictures."""
    return {
        "device": str(folder),
        "replay.rate_hz": float(RATE_HZ),
        "width_px": 640,
        "height_px": 480,
        "camera_info_url": f"file://{calibration_of(folder)}",
    }


def cameras(folders: Mapping[str, Path]) -> dict[str, Command]:
    """Return the commands of both cameras."""
    return {
        f"camera_node.{eye}": NodeCommand.of("camera_node", camera_parameters(folder), [f"__ns:=/{eye}"])
        for eye, folder in folders.items()
    }


def measure(
    commands: Mapping[str, Command], empty: Sequence[str] = (), settled_s: float = SETTLED_S, goal: bool = False
) -> dict[str, Share]:
    """Run the nodes together, and empty nodes of these kinds beside them; return each one's share by its name.

    With `goal` the controller looks at the middle of the image while they are measured.
    """
    with own_domain() as domain:
        extra = {"ROS_DOMAIN_ID": str(domain)}
        with ProcessGroup(OUT_DIR / "budget_logs", extra) as nodes, _empty_nodes(empty, extra) as beside:
            for name, command in commands.items():
                nodes.start(name, command)
            pids = {name: nodes.pid(name) for name in commands} | beside
            if goal:
                time.sleep(_STARTED_S)
                subprocess.run([sys.executable, "-m", "bench.budget_goal"], env=environment(extra), check=True)
            time.sleep(settled_s)
            before, began = {name: cpu_s(pid) for name, pid in pids.items()}, time.monotonic()
            time.sleep(MEASURED_S)
            nodes.check()
            elapsed = time.monotonic() - began
            return {name: Share((cpu_s(pid) - before[name]) / elapsed, rss_mb(pid)) for name, pid in pids.items()}


@contextmanager
def _empty_nodes(kinds: Sequence[str], extra: dict[str, str]) -> Iterator[dict[str, int]]:
    running = {
        f"empty.{kind}": subprocess.Popen(
            [sys.executable, "-m", "bench.budget_empty_node", kind], env=environment(extra), stderr=subprocess.DEVNULL
        )
        for kind in kinds
    }
    try:
        yield {name: process.pid for name, process in running.items()}
    finally:
        for process in running.values():
            process.terminate()
        for process in running.values():
            end(process, 5.0)
