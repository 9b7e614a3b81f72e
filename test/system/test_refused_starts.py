"""What cannot start ends with one line that names the thing, what must hold and the value, and status 2."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from vergence_bringup.node_table import HOSTS, NODES, package_of, parameter_groups
from vergence_bringup.ros.processes import find_node

pytestmark = pytest.mark.system

TIMEOUT_S = 150.0
ENVIRONMENTS = [
    ({"ROS_DOMAIN_ID": "abc"}, "ROS_DOMAIN_ID must be a whole number from 0 to 232: got 'abc'"),
    ({"ROS_DOMAIN_ID": "233"}, "ROS_DOMAIN_ID must be a whole number from 0 to 232: got '233'"),
    ({"ROS_DOMAIN_ID": "-1"}, "ROS_DOMAIN_ID must be a whole number from 0 to 232: got '-1'"),
    ({"RMW_IMPLEMENTATION": "rmw_nosuch"}, "RMW_IMPLEMENTATION must be a middleware that is installed"),
    ({"HOME": "/proc/nobody"}, "HOME must be a folder in which logs can be written: got '/proc/nobody'"),
    ({"ROS_LOG_DIR": "/proc/logs"}, "ROS_LOG_DIR must be a folder in which logs can be written: got '/proc/logs'"),
]
ROS_ARGUMENTS = [
    (["-r", "__ns:=head/"], "got 'head/'"),
    (["-r", "__ns:=/1a"], "namespace must not have a token that starts with a number: got '/1a'"),
    (["-r", "__node:=a b"], "got 'a b'"),
    (["-p", "use_sim_time:=5"], "'use_sim_time'"),
    (["-p", "qos_overrides./joint_states.publisher.dept:=5"], "qos_overrides./joint_states.publisher.depth"),
    (["-p", "qos_overrides./joint_states.publisher.depth:=deep"], "qos_overrides./joint_states.publisher.depth"),
    (["--nosuch"], "--nosuch"),
]
COMMANDS = [["watch", "--once", "0.1"], ["look", "--angles", "0", "8", "5"], ["identify", "--out", "/dev/null"]]


def _run(command: list[str], environment: dict[str, str]) -> "subprocess.CompletedProcess[str]":
    kept = {name: value for name, value in os.environ.items() if name not in ("ROS_HOME", "ROS_LOG_DIR")}
    return subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, env=kept | environment)


def _only_line(result: "subprocess.CompletedProcess[str]", begin: str) -> str:
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    (line,) = [line for line in result.stderr.splitlines() if "deprecated" not in line]
    assert line.startswith(begin)
    return line


@pytest.mark.parametrize(("environment", "text"), ENVIRONMENTS)
def test_an_environment_in_which_a_node_cannot_start(environment: dict[str, str], text: str, domain_id: int) -> None:
    assert text in _only_line(_run([str(find_node("servo_node"))], environment), "servo_node: ")


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
@pytest.mark.parametrize(("environment", "text"), [ENVIRONMENTS[0], ENVIRONMENTS[3], ENVIRONMENTS[4]])
def test_an_environment_in_which_a_command_cannot_start(
    command: list[str], environment: dict[str, str], text: str, domain_id: int
) -> None:
    assert text in _only_line(
        _run([sys.executable, "-m", "vergence_bringup.command_line", *command], environment), f"vergence {command[0]}: "
    )


def test_a_namespace_that_cannot_be_ends_a_command(domain_id: int) -> None:
    for command in COMMANDS:
        result = _run([sys.executable, "-m", "vergence_bringup.command_line", *command, "--namespace", "head/"], {})
        assert "namespace must not end with" in _only_line(result, f"vergence {command[0]}: ")


@pytest.mark.parametrize(("arguments", "text"), ROS_ARGUMENTS)
def test_arguments_of_ros_that_cannot_be(arguments: list[str], text: str, domain_id: int, tmp_path: Path) -> None:
    given = ["-p", "backend:=fake", "-p", f"pose_file:={tmp_path / 'pose.json'}"]
    result = _run([str(find_node("servo_node")), "--ros-args", *given, *arguments], {})
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    (line,) = [line for line in result.stderr.splitlines() if line.startswith("servo_node: ")]
    assert text in line


@pytest.mark.parametrize("option", ["--params-file", "rig", "servos", "pose_file"])
def test_a_pipe_instead_of_a_file(option: str, domain_id: int, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    given = [option, str(pipe)] if option.startswith("--") else ["-p", f"{option}:={pipe}"]
    result = _run([str(find_node("servo_node")), "--ros-args", "-p", "backend:=fake", *given], {})
    assert "must be" in _only_line(result, "servo_node: ")


@pytest.mark.parametrize("executable", sorted(NODES))
@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"/**:\n  ros__parameters: {a: [[[[" + b"[" * 100, "nested at most 20 deep"),
        (b"\xff\xfe\x00", "text in UTF-8"),
        (b"nosuch_node:\n  ros__parameters: {a: 1}\n", "it has them for /nosuch_node"),
        (b'/**:\n  ros__parameters: {"\\ud800": 1}\n', "surrogate"),
    ],
    ids=["nesting", "binary", "name of the node", "surrogate"],
)
def test_a_parameter_file_that_cannot_be(
    executable: str, text: bytes, words: str, domain_id: int, tmp_path: Path
) -> None:
    (tmp_path / "file.yaml").write_bytes(text)
    result = _run([str(find_node(executable)), "--ros-args", "--params-file", str(tmp_path / "file.yaml")], {})
    assert words in _only_line(result, f"{executable}: ")


def test_a_parameter_file_of_one_node_of_a_host(domain_id: int, tmp_path: Path) -> None:
    (tmp_path / "file.yaml").write_text("servo_nod:\n  ros__parameters: {backend: fake}\n")
    given = ["--nodes", "servo_node", "--params", f"servo_node={tmp_path / 'file.yaml'}"]
    assert "write '/**/servo_node:'" in _only_line(_run([str(find_node("head_node")), *given], {}), "head_node: ")


@pytest.mark.parametrize("executable", sorted({*NODES, *HOSTS}))
def test_arguments_that_nothing_reads_and_help(executable: str, domain_id: int) -> None:
    path = str(find_node(executable))
    refused = _run([path, "--params-file", "F", "-p", "backend:=nosuch"], {})
    assert refused.returncode == 2
    assert refused.stderr.splitlines()[-1].startswith(f"{executable}: ")
    helped = _run([path, "--help"], {})
    assert (helped.returncode, helped.stderr) == (0, "")
    assert helped.stdout.startswith(f"usage: {executable} ")
    if executable in NODES:
        assert package_of(executable)
        for prefix, group in parameter_groups(executable):
            assert all(f"  {prefix}{spec.name} (" in helped.stdout for spec in group.specs())
