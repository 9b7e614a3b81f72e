"""The arguments of the launch files: values are checked before anything starts, on machines without launch too."""

import re
import shlex
from pathlib import Path

import pytest

from vergence_bringup.launching.arguments import ARGUMENTS, defaults, problems, unknown
from vergence_bringup.launching.endings import OPTIONAL, ending
from vergence_bringup.launching.servo_choice import chosen_backend, fakes_banner
from vergence_bringup.launching.servo_choice import problems as servo_problems
from vergence_bringup.node_table import NODES

PACKAGE = Path(__file__).resolve().parents[1]
ROOT = PACKAGE.parents[1]
SERVOS = str(PACKAGE / "config" / "servos.yaml")
PAGES = [path for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))) if path.is_file()]


def launch_lines() -> list[tuple[str, list[str]]]:
    """Return (launch file, NAME:=VALUE words) of every `ros2 launch` of the pages and launch files' docstrings."""
    found = []
    for path in PAGES + sorted((PACKAGE / "launch").glob("*.py")):
        text = re.sub(r"\n {4}(?=[a-z\[]\S*:=)", " ", path.read_text(encoding="utf-8"))
        for line in re.findall(r"(?:ros2 launch vergence_bringup |`)([a-z]+\.launch\.py[^`\n]*)", text):
            file, *words = shlex.split(re.sub(r"#.*|\||[()\[\]]|, and.*", "", line))
            found.append((file, [word for word in words if ":=" in word]))
    return found


def test_every_launch_file_is_in_the_table():
    assert sorted(ARGUMENTS) == sorted(path.name for path in (PACKAGE / "launch").glob("*.py"))


@pytest.mark.parametrize("file", sorted(ARGUMENTS))
def test_the_defaults_are_values_that_are_allowed(file):
    values = defaults(file, PACKAGE / "config")
    assert problems(file, values) == []
    assert unknown(file, [file, *(f"{name}:={value}" for name, value in values.items())]) == []


def test_what_an_argument_is_called_means_the_same_in_every_launch_file():
    kinds: dict[str, set[tuple[tuple[str, ...], bool]]] = {}
    for arguments in ARGUMENTS.values():
        for argument in arguments:
            kinds.setdefault(argument.name, set()).add((argument.choices, argument.is_file))
    assert {name: kind for name, kind in kinds.items() if len(kind) > 1} == {}


def test_the_laptop_has_the_arguments_of_the_rig_but_the_servos():
    rig, laptop = ({argument.name for argument in ARGUMENTS[file]} for file in ("rig.launch.py", "laptop.launch.py"))
    assert rig - laptop == {"servos", "backend", "servo_node"}
    assert laptop - rig == {"discovery_range"}


@pytest.mark.parametrize(
    ("file", "name", "value", "problem"),
    [
        ("sim.launch.py", "detector", "no", "detector must be true or false: got 'no'"),
        ("sim.launch.py", "preset", "perfect", "preset must be realistic or ideal: got 'perfect'"),
        (
            "sim.launch.py",
            "head",
            "wooden",
            "head must be printed, rolled, ideal, rig or the path of an existing file: got 'wooden'",
        ),
        ("rig.launch.py", "servos", "false", "servos must be the path of an existing file: got 'false'"),
        ("rig.launch.py", "servos", "/nowhere/servos.yaml", "existing file: got '/nowhere/servos.yaml'"),
        ("rig.launch.py", "servo_node", SERVOS, "servo_node must be true or false"),
        ("pi.launch.py", "servos", "", "servos must be the path of an existing file: got ''"),
        ("pi.launch.py", "discovery_range", "WIDE", "discovery_range must be SUBNET, LOCALHOST, SYSTEM_DEFAULT or OFF"),
    ],
)
def test_a_wrong_value_is_named(file, name, value, problem):
    (found,) = problems(file, {name: value})
    assert problem in found


@pytest.mark.parametrize(
    ("argv", "found"),
    [
        (["ros2", "launch", "vergence_bringup", "rig.launch.py", "backnd:=pca9685"], "did you mean 'backend'"),
        (["ros2", "launch", "/x/install/share/launch/rig.launch.py", "speed:=9"], "has no argument 'speed'"),
        (["ros2", "launch", "vergence_bringup", "rig.launch.py", "backend:=pca9685"], ""),
        (["ros2", "launch", "vergence_bringup", "rig.launch.py", "launch-prefix:=gdb"], ""),
        (["ros2", "launch", "my_robot", "robot.launch.py", "arms:=2"], ""),  # it includes rig.launch.py
    ],
)
def test_an_argument_that_does_not_exist_is_named_with_the_nearest_one(argv, found):
    assert (found in "".join(unknown("rig.launch.py", argv))) if found else unknown("rig.launch.py", argv) == []


@pytest.mark.parametrize(
    ("servos", "backend", "chosen"),
    [("", "", "fake"), (SERVOS, "", "kernel_pwm"), (SERVOS, "pca9685", "pca9685"), ("", "fake", "fake")],
)
def test_the_backend_follows_from_what_is_given(servos, backend, chosen):
    values = {"servos": servos, "backend": backend}
    assert chosen_backend(values) == chosen
    assert servo_problems(values) == []


@pytest.mark.parametrize(
    ("servos", "backend", "problem"),
    [
        ("", "kernel_pwm", "servos must be the path of your servos.yaml with backend 'kernel_pwm'"),
        (SERVOS, "gpiozero", "backend must not be 'gpiozero'"),
        (SERVOS, "kernelpwm", "backend must be one of fake, kernel_pwm"),
        (str(PACKAGE / "package.xml"), "", "servo file"),
    ],
)
def test_servos_that_could_not_be_driven_are_named(servos, backend, problem):
    (found,) = servo_problems({"servos": servos, "backend": backend})
    assert problem in found


def test_a_head_on_fakes_says_so_in_big_letters(tmp_path):
    text = fakes_banner({"servos": "", "backend": ""})
    assert "NO SERVO MOVES: this head" in text
    assert "servos:=" in text
    assert "!!!!!!!!!!" in text
    assert fakes_banner({"servos": SERVOS, "backend": ""}) == ""
    path = tmp_path / "servos.yaml"
    path.write_text("servos: {pan_left: {channel: 0}, pan_right: {channel: 1}, tilt: {channel: 0, backend: fake}}\n")
    mixed = {"servos": str(path), "backend": ""}
    assert servo_problems(mixed) == []
    assert "NO SERVO MOVES: tilt of this head" in fakes_banner(mixed)


@pytest.mark.parametrize(
    ("tilt", "problem"),
    [
        ("{channel: 0, backend: pca9685}", ""),
        ("{channel: 0, backend: pca9865}", "servos.tilt.backend must be one of"),
        ("{channel: 0, backend: kernel_pwm}", "different channel of backend 'kernel_pwm': got 0 for pan_left and tilt"),
    ],
)
def test_a_servo_may_name_its_own_backend(tilt, problem, tmp_path):
    path = tmp_path / "servos.yaml"
    path.write_text(f"servos: {{pan_left: {{channel: 0}}, pan_right: {{channel: 1}}, tilt: {tilt}}}\n")
    found = servo_problems({"servos": str(path), "backend": ""})
    assert problem in "".join(found)
    assert bool(found) == bool(problem)


def test_a_node_without_which_a_head_still_verges_does_not_end_it():
    assert OPTIONAL.keys() <= NODES.keys() | {"robot_state_publisher"}
    for executable in NODES:
        for status in (0, 1, 2, -9):
            follows = ending(executable, status)
            assert executable in follows.text
            assert follows.ends_launch == (executable not in OPTIONAL)
    assert "killed by signal 9" in ending("sim_node", -9).text
    assert not ending("servo_node", -11, respawns=True).ends_launch
    assert ending("servo_node", 2, respawns=True).ends_launch


@pytest.mark.skipif(not PAGES, reason="the pages are not here")
def test_the_pages_use_arguments_and_values_that_exist():
    lines = launch_lines()
    assert len(lines) > 8
    for file, words in lines:
        assert unknown(file, [file, *words]) == [], (file, words)
        values = dict(word.split(":=", 1) for word in words)
        files = {argument.name for argument in ARGUMENTS[file] if argument.is_file and not argument.choices}
        assert problems(file, {name: value for name, value in values.items() if name not in files}) == [], (file, words)
        # A path in a page is an example.
        assert all("/" in value or value.endswith(".yaml") for name, value in values.items() if name in files), words
