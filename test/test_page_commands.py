"""Every command of README and docs can be typed: its executable, options, parameters, files and packages exist.

What is launched is checked in vergence_bringup's test_launch_arguments.py.
"""

import argparse
import importlib
import itertools
import re
import shlex
from pathlib import Path

import pytest
import yaml

from vergence_bringup.command_line import COMMANDS
from vergence_bringup.node_table import NODES, parameter_groups

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]

APT = {
    "build-essential",
    "chrony",
    "git",
    "gpiod",
    "i2c-tools",
    "libegl1",
    "libgl1-mesa-dri",
    "python3-dev",
    "python3-libgpiod",
    "python3-lgpio",
    "python3-pip",
    "python3-venv",
    "ros-dev-tools",
    "ros-jazzy-control-msgs",
    "ros-jazzy-foxglove-bridge",
    "ros-jazzy-ros-base",
}
"""Packages that Ubuntu 24.04 or ROS's own repository have; there is no pigpio, and no pigpiod."""
OF_THE_SYSTEM = {
    *("cd", "chronyc", "cp", "echo", "export", "git", "groups", "groupadd", "i2cdetect", "journalctl", "ls", "mkdir"),
    *(
        "nano",
        "printf",
        "reboot",
        "rosdep",
        "rviz2",
        "source",
        "sudo",
        "systemctl",
        "tee",
        "touch",
        "ufw",
        "usermod",
        "colcon",
    ),
}
"""Commands that the pages may use without a check of their own."""
ROS2 = {"action", "bag", "launch", "param", "pkg", "run", "topic"}
POINT_HEAD = {"target", "pointing_axis", "pointing_frame", "min_duration", "max_velocity"}
"""Fields of a goal of control_msgs/PointHead."""
PLACEHOLDER = re.compile(r"\.\.\.|<[^>]*>|\bBAG\b")


def commands() -> list[tuple[str, str]]:
    """Return (page, command) of every sh block of the pages, comments and continued lines resolved."""
    found = []
    for page in PAGES:
        for block in re.findall(r"^ *```sh\n(.*?)^ *```", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.M):
            text = re.sub(r"\\\n\s*", " ", re.sub(r"<<'(\w+)'\n.*?^\s*\1$", "", block, flags=re.DOTALL | re.M))
            for line in text.splitlines():
                bare = re.sub(r"(^|\s)#.*$", "", line).strip()
                parts = re.split(r"\s*(?:&&|;|\|)\s+", bare) if "'" not in bare else [bare]
                found += [(page.name, part) for part in parts if part]
    return found


def inline_commands() -> list[tuple[str, str]]:
    """Return (page, command) of every `ros2 run ...`, `vergence ...` and pip command within the text."""
    found = []
    for page in PAGES:
        text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
        for quoted in re.findall(r"`([^`]+)`", text):
            line = " ".join(quoted.split())
            if re.match(r"(ros2 run \w|vergence [a-z]+ -|python3? -m pip|pip3? |sudo apt)", line):
                found.append((page.name, line))
    return found


def executables() -> dict[str, str]:
    """Return the package of every executable."""
    found = {}
    for path in ROOT.glob("src/*/setup.py"):
        for name in re.findall(r'"(\w+) = vergence_', path.read_text(encoding="utf-8")):
            found[name] = path.parent.name
    return found


def words(line: str) -> list[str]:
    return shlex.split(re.sub(r"\$\([^)]*\)", "SUBSTITUTED", line.replace("$(ros2 pkg prefix --share", "$(")))


def check_ros2(line: str) -> None:
    given = words(line)
    assert given[1] in ROS2, line
    if given[1] == "run":
        assert executables().get(given[3], "diagnostic_aggregator") == given[2], line
        parameters = [word.split(":=")[0] for before, word in itertools.pairwise(given) if before == "-p"]
        if given[3] in NODES:
            known = {prefix + spec.name for prefix, group in parameter_groups(given[3]) for spec in group.specs()}
            assert set(parameters) <= known | {"use_sim_time"}, line
    if given[1:3] == ["action", "send_goal"]:
        action = (ROOT / "src/vergence_msgs/action/LookAt.action").read_text(encoding="utf-8").split("\n---")[0]
        fields = set(re.findall(r"^[\w/]+\s+(\w+)\s*(?:#.*)?$", action, flags=re.M))
        assert set(yaml.safe_load(given[-1])) <= (POINT_HEAD if "point_head" in line else fields), line


def check_vergence(line: str) -> None:
    name, *arguments = words(line)[1:]
    parser = argparse.ArgumentParser(exit_on_error=False)
    importlib.import_module(COMMANDS[name][0]).add_arguments(parser)
    try:
        parser.parse_args(arguments)
    except SystemExit as error:
        pytest.fail(f"{line}: {error}")


def check_pip(line: str, before: list[str]) -> None:
    """Ubuntu refuses pip outside a virtual environment, but for the flag."""
    in_environment = any("bin/activate" in earlier or "env.sh" in earlier for earlier in before)
    assert in_environment or "--user --break-system-packages" in line, line
    for word in words(line):
        if word.endswith(".txt"):
            assert (ROOT / word.removeprefix("src/vergence/")).is_file(), line


def check_apt(line: str) -> None:
    packages = [word for word in words(line.split("&&")[-1]) if word not in ("sudo", "apt", "install", "-y", "update")]
    assert set(packages) <= APT, line


@pytest.mark.parametrize(("page", "line"), dict.fromkeys(commands()), ids=str)
def test_a_command_of_a_block_can_be_typed(page: str, line: str) -> None:
    first = line.split()[0].split("/")[-1]
    if PLACEHOLDER.search(line) and first != "ros2":
        return
    if first == "ros2":
        check_ros2(line)
    elif first == "vergence":
        check_vergence(line)
    elif first == "make":
        target = words(line)[1]
        assert target == "-C" or re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), flags=re.M), line
    elif "pip install" in line:
        earlier = [text for name, text in commands() if name == page]
        check_pip(line, earlier[: earlier.index(line)])
    elif line.startswith("sudo apt"):
        check_apt(line)
    elif first == "python" or first.startswith("python3"):
        assert words(line)[1] in ("-m",) or "colcon" in line or (ROOT / words(line)[1]).is_file(), line
    else:
        assert first in OF_THE_SYSTEM or line.startswith("sudo env "), line


@pytest.mark.parametrize(("page", "line"), dict.fromkeys(inline_commands()), ids=str)
def test_a_command_within_the_text_can_be_typed(page: str, line: str) -> None:
    if line.startswith("ros2"):
        check_ros2(line)
    elif line.startswith("vergence"):
        if not PLACEHOLDER.search(line) and not re.search(r"--[a-z-]+$|[A-Z]{2,}", line):
            check_vergence(line)
    elif "pip" in line.split()[:3]:
        check_pip(line, [])
    else:
        check_apt(line)


def test_the_configuration_lines_of_the_pi_are_the_ones_that_the_errors_name() -> None:
    from vergence_servo.drivers import kernel_pwm

    pages = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert pages.count(kernel_pwm._OVERLAY) >= 2


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_every_link_to_a_file_leads_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), f"{page.name}: {target}"
