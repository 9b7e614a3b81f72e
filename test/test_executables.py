"""What an executable does while its module is imported: it can be interrupted, and names a package that is missing."""

import ast
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from vergence_bringup.command_line import COMMANDS
from vergence_bringup.node_table import HOSTS, NODES

ROOT = Path(__file__).resolve().parents[1]
HEAVY = ("rclpy", "numpy", "cv2", "yaml", "mujoco")
TIMEOUT_S = 150.0
# Stands for every package that takes long to import.
SLOW = "print('importing', flush=True)\nimport threading\nthreading.Event().wait()\n"


def entry_points() -> dict[str, str]:
    """Return "module:function" by the name of the executable, of all packages whose executables import late."""
    found: dict[str, str] = {}
    for path in ROOT.glob("src/*/setup.py"):
        strings = [node.value for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Constant)]
        found |= dict(text.split(" = ") for text in strings if isinstance(text, str) and " = vergence_" in text)
    return {name: place for name, place in found.items() if ".executables:" in place}


def start(place: str, *path: Path) -> "subprocess.Popen[str]":
    module, function = place.split(":")
    code = f"import sys; from {module} import {function}; sys.argv[0] = '{function}'; sys.exit({function}())"
    env = os.environ | {"PYTHONPATH": os.pathsep.join([*map(str, path), os.environ.get("PYTHONPATH", "")])}
    return subprocess.Popen(
        [sys.executable, "-c", code], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_every_executable_imports_late() -> None:
    assert NODES.keys() | HOSTS.keys() | {"list_cameras", "calibrate_servos"} == entry_points().keys()


@pytest.mark.parametrize("place", entry_points().values(), ids=entry_points().keys())
def test_ctrl_c_while_importing_ends_an_executable_without_a_traceback(place: str, tmp_path: Path) -> None:
    for name in HEAVY:
        (tmp_path / f"{name}.py").write_text(SLOW)
    process = start(place, tmp_path)
    if place.endswith(":list_cameras"):
        process.kill()  # imports nothing slow
        process.communicate()
        return
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "importing\n"
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=TIMEOUT_S)
    finally:
        process.kill()
    assert process.returncode == -signal.SIGINT
    assert errors == ""


@pytest.mark.parametrize("command", COMMANDS)
def test_ctrl_c_while_importing_ends_a_command_without_a_traceback(command: str, tmp_path: Path) -> None:
    for name in HEAVY:
        (tmp_path / f"{name}.py").write_text(SLOW)
    env = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    argv = [sys.executable, "-m", "vergence_bringup.command_line", command]
    process = subprocess.Popen(argv, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        if process.stdout.readline() == "importing\n":  # doctor imports nothing slow before it runs
            process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=TIMEOUT_S)
    finally:
        process.kill()
    assert "Traceback" not in errors


def test_a_package_that_is_missing_is_one_line_with_the_command_that_installs_it(tmp_path: Path) -> None:
    (tmp_path / "mujoco.py").write_text("raise ModuleNotFoundError(\"No module named 'mujoco'\", name='mujoco')\n")
    process = start(entry_points()["sim_node"], tmp_path)
    _, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 2
    (line,) = errors.splitlines()
    assert line.startswith("sim_node: mujoco is not installed: python3 -m pip install ")


def test_a_command_whose_package_is_not_built_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "vergence_calibration").mkdir()
    missing = "raise ModuleNotFoundError('no', name='vergence_calibration')\n"
    (tmp_path / "vergence_calibration" / "__init__.py").write_text(missing)
    env = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    argv = [sys.executable, "-m", "vergence_bringup.command_line", "identify"]
    ran = subprocess.run(argv, env=env, capture_output=True, text=True, timeout=TIMEOUT_S)
    assert ran.returncode == 2
    (line,) = ran.stderr.splitlines()
    assert "vergence_calibration: the package is not built here" in line
