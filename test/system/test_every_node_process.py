"""Every node as users start it: clean ends on signals, one clear line and status 2 on what it cannot use."""

import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from vergence_bringup.node_table import NODES, parameter_groups
from vergence_bringup.ros.processes import find_node

pytestmark = pytest.mark.system

TIMEOUT_S = 150.0
CONFIG = Path(__file__).resolve().parents[2] / "config"


def _command(executable: str, *arguments: str) -> list[str]:
    return [str(find_node(executable)), "--ros-args", *arguments]


def _run(executable: str, *arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(_command(executable, *arguments), capture_output=True, text=True, timeout=TIMEOUT_S)


def _own_lines(text: str, executable: str) -> list[str]:
    return [line for line in text.splitlines() if line.startswith(f"{executable}: ")]


@pytest.mark.parametrize("executable", sorted(NODES))
def test_an_unknown_parameter_ends_the_node(executable: str, domain_id: int) -> None:
    result = _run(executable, "--params-file", str(CONFIG / f"{executable}.yaml"), "-p", "no_such_parameter:=1")
    assert result.returncode == 2
    (line,) = _own_lines(result.stderr, executable)
    assert "no_such_parameter" in line
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("executable", sorted(NODES))
def test_a_rig_that_is_not_there_ends_the_node(executable: str, domain_id: int, tmp_path: Path) -> None:
    specs = [(prefix, spec) for prefix, group in parameter_groups(executable) for spec in group.specs()]
    required = [f"{prefix}{spec.name}:=/dev/null" for prefix, spec in specs if spec.required]
    arguments = [argument for value in required for argument in ("-p", value)]
    result = _run(executable, "-p", f"rig:={tmp_path / 'absent.yaml'}", *arguments)
    assert result.returncode == 2
    (line,) = _own_lines(result.stderr, executable)
    assert "absent.yaml" in line


@pytest.mark.parametrize("executable", sorted(NODES))
def test_a_file_that_is_not_yaml_ends_the_node(executable: str, domain_id: int, tmp_path: Path) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text("/**: [ros__parameters: {")
    result = _run(executable, "--params-file", str(path))
    assert result.returncode == 2
    (line,) = _own_lines(result.stderr, executable)
    assert "broken.yaml" in line


@pytest.mark.parametrize("delay_s", [0.1, 0.7, 1.5, 3.0])
def test_sigterm_at_any_moment_ends_sim_node_without_complaint(delay_s: float, domain_id: int) -> None:
    """Imports, the scene's compilation, and the first frames each meet the signal at some delay."""
    with subprocess.Popen(_command("sim_node"), stderr=subprocess.PIPE, text=True) as process:
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(delay_s)
        process.terminate()
        try:
            _, errors = process.communicate(timeout=TIMEOUT_S)
        finally:
            process.kill()
    # While Python still imports, the signal simply ends it: there is nothing to release yet.
    assert process.returncode in (0, -signal.SIGTERM), errors
    assert "Traceback" not in errors


SLOW_WORLD = """
import sys, threading
from vergence_common.node_main import run_node
from vergence_sim.ros.sim_node import SimNode

class SlowNode(SimNode):
    def _make_world(self):
        print("making the world", flush=True)
        threading.Event().wait()

sys.exit(run_node(SlowNode))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_sim_node_while_it_builds_its_room(number: int, domain_id: int) -> None:
    """The room here is never ready."""
    with subprocess.Popen(
        [sys.executable, "-c", SLOW_WORLD], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "making the world\n"
        process.send_signal(number)
        try:
            _, errors = process.communicate(timeout=TIMEOUT_S)
        finally:
            process.kill()
    assert process.returncode == 0, errors
    assert "Traceback" not in errors


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_running_node_with_status_0(number: int, domain_id: int) -> None:
    with subprocess.Popen(_command("sim_node"), stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        watchdog = threading.Timer(TIMEOUT_S, process.kill)
        watchdog.start()
        lines = []
        for line in process.stderr:
            lines.append(line)
            if "ready" in line:
                process.send_signal(number)
        watchdog.cancel()
        watchdog.join()
    assert process.returncode == 0, lines
    assert "Traceback" not in "".join(lines)
