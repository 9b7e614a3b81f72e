"""Nodes as processes: found, started, monitored and ended together."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Protocol

from ament_index_python.packages import PackageNotFoundError, get_package_prefix, get_package_share_directory

from vergence_bringup.graph_errors import ProcessError
from vergence_bringup.machine import build_hint
from vergence_bringup.node_table import NODES, package_of

_PR_SET_PDEATHSIG = 1


def config_dir() -> Path:
    """Return the folder of the shipped YAML files: VERGENCE_CONFIG_DIR, or the installed one."""
    if "VERGENCE_CONFIG_DIR" in os.environ:
        return Path(os.environ["VERGENCE_CONFIG_DIR"])
    return Path(get_package_share_directory("vergence_bringup")) / "config"


def find_executable(package: str, executable: str) -> Path:
    """Return the path that `ros2 run package executable` would run."""
    try:
        path = Path(get_package_prefix(package)) / "lib" / package / executable
    except PackageNotFoundError:
        raise ProcessError(
            f"package {package!r} is not built, or this shell does not have it: {build_hint()}"
        ) from None
    if not path.exists():
        raise ProcessError(f"executable of {package} must be in {path.parent}: got {executable!r}")
    return path


def find_node(executable: str) -> Path:
    """Return the path of a node or host of nodes of the table; raises ProcessError where it is not built."""
    return find_executable(package_of(executable), executable)


class Command(Protocol):
    """What can be started as a process."""

    def argv(self) -> list[str]:
        """Return the command line."""
        ...


@dataclass(frozen=True)
class NodeCommand:
    """The command line of one node: parameters override its YAML file, remappings are 'from:=to'."""

    package: str
    executable: str
    parameters: Mapping[str, object] | None = None
    remappings: Sequence[str] = ()
    params_file: Path | None = None

    @classmethod
    def of(
        cls, executable: str, parameters: Mapping[str, object] | None = None, remappings: Sequence[str] = ()
    ) -> "NodeCommand":
        """Return the command of a node of the table, with its shipped YAML file."""
        return cls(NODES[executable].package, executable, parameters, remappings)

    def argv(self) -> list[str]:
        """Return the command line."""
        argv = [str(find_executable(self.package, self.executable)), "--ros-args"]
        params_file = self.params_file or config_dir() / f"{self.executable}.yaml"
        argv += ["--params-file", str(params_file)]
        for name, value in (self.parameters or {}).items():
            argv += ["-p", f"{name}:={_yaml(value)}"]
        for remapping in self.remappings:
            argv += ["-r", remapping]
        return argv


def _yaml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_yaml(element) for element in value) + "]"
    # Quoted, so that an empty or numeric string stays a string.
    return f'"{value}"' if isinstance(value, str) else repr(value)


def environment(extra: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return this process's environment, the shipped Fast DDS profile, discovery limited to this host, and `extra`."""
    env = dict(os.environ)
    env.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(config_dir() / "fastdds.xml"))
    env.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    env["PYTHONUNBUFFERED"] = "1"
    return env | dict(extra or {})


class ProcessGroup:
    """Processes that are started and ended together; a context manager that ends them all on exit.

    Each is in a process group of its own, so that a Ctrl-C in the terminal reaches it only through `stop`, once; the
    kernel sends each a SIGTERM if this process dies without stopping it. They stay in one session, as nodes of one
    launch do: Linux shares the cores evenly between sessions, whatever the niceness within them.
    """

    def __init__(self, log_dir: Path | None = None, extra_environment: Mapping[str, str] | None = None) -> None:
        self._log_dir = log_dir
        self._environment = environment(extra_environment)
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._logs: list[IO[bytes]] = []

    def __enter__(self) -> "ProcessGroup":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def start(self, name: str, command: Command) -> None:
        """Start one node; its output goes to `<log_dir>/<name>.log`, or to this process's."""
        output: IO[bytes] | None = None
        if self._log_dir is not None:
            self._log_dir.mkdir(parents=True, exist_ok=True)
            output = open(self._log_dir / f"{name}.log", "wb")  # noqa: SIM115 - closed by stop()
            self._logs.append(output)
        self._running[name] = subprocess.Popen(
            command.argv(),
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT if output else None,
            env=self._environment,
            preexec_fn=_lead_a_group_and_die_with_parent,
        )

    def pid(self, name: str) -> int:
        """Return the process id of a node that was started."""
        return self._running[name].pid

    def check(self) -> None:
        """Raise ProcessError if a process has ended unexpectedly."""
        for name, process in self._running.items():
            if process.poll() is not None:
                raise ProcessError(f"{name} ended with status {process.returncode}{self._tail(name)}")

    def stop(self, timeout_s: float = 5.0) -> dict[str, int]:
        """End all: SIGINT, SIGTERM after `timeout_s`, then SIGKILL. Return the exit status of each by name."""
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            waiting = [process for process in self._running.values() if process.poll() is None]
            for process in waiting:
                _signal_group(process.pid, number)
            deadline = time.monotonic() + timeout_s
            for process in waiting:
                try:
                    process.wait(max(0.01, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    continue
        statuses = {name: process.returncode for name, process in self._running.items()}
        for log in self._logs:
            log.close()
        self._running, self._logs = {}, []
        return statuses

    def _tail(self, name: str) -> str:
        if self._log_dir is None:
            return ""
        path = self._log_dir / f"{name}.log"
        lines = path.read_text(errors="replace").strip().splitlines()[-5:]
        return f"; the end of {path}:\n  " + "\n  ".join(lines)


def _signal_group(pid: int, number: int) -> None:
    try:
        os.killpg(pid, number)
    except ProcessLookupError:
        return


def _lead_a_group_and_die_with_parent() -> None:
    os.setpgid(0, 0)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
