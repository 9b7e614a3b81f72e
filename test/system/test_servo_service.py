"""The service of servo_node: the shipped unit, and its script as systemd runs it, with hardly any environment."""

import configparser
import os
import re
import shutil
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

pytestmark = pytest.mark.system

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "src" / "vergence_bringup" / "systemd"
UNIT = FOLDER / "vergence-servo@.service"
TIMEOUT_S = 120.0


@pytest.fixture
def unit() -> configparser.RawConfigParser:
    parser = configparser.RawConfigParser(strict=True)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(UNIT)
    return parser


def test_the_unit_restarts_crashes_only_and_lets_the_guardians_finish(unit: configparser.RawConfigParser) -> None:
    service = unit["Service"]
    assert service["Restart"] == "on-failure"
    assert service["RestartPreventExitStatus"] == "2"
    assert service["KillMode"] == "control-group"
    # Parking on SIGTERM takes up to park_time_limit_s, 2 s as shipped and 30 s at most.
    assert float(service["TimeoutStopSec"]) > 2.0
    assert service["ExecStart"].endswith("/share/vergence_bringup/systemd/run_servo_node")


def test_the_unit_needs_no_home(unit: configparser.RawConfigParser) -> None:
    assert unit["Service"]["Environment"] == f"ROS_HOME=/var/lib/{unit['Service']['StateDirectory']}"


def test_systemd_accepts_the_units(tmp_path: Path) -> None:
    """The shipped one, and that of the page which switches a PCA9685's outputs on and off with it."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed here")
    page = (ROOT / "docs" / "servos.md").read_text(encoding="utf-8")
    (outputs,) = re.findall(r"```ini\n(.*?)```", page, flags=re.DOTALL)
    # What is judged is the units, not this machine's users and files.
    servo = UNIT.read_text().replace("User=%i", "User=root").replace("/bin/bash ${WORKSPACE}", "/bin/true ${WORKSPACE}")
    units = {"vergence-servo@me.service": servo, "vergence-oe.service": textwrap.dedent(outputs)}
    for name, text in units.items():
        (tmp_path / name).write_text(text)
    command = ["systemd-analyze", "verify", *(str(tmp_path / name) for name in units)]
    environment = os.environ | {"SYSTEMD_UNIT_PATH": f"{tmp_path}:"}
    ran = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, env=environment)
    assert [line for line in ran.stderr.splitlines() if any(name in line for name in units)] == []


@pytest.fixture
def setup(tmp_path: Path) -> Path:
    """What /opt/ros/jazzy/setup.bash is on a ROS machine: here this environment's ROS, from wheels or from apt."""
    lines = [f'export PATH="{Path(sys.executable).parent}:$PATH"']
    for name in ("AMENT_PREFIX_PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "ROS_DISTRO", "ROS_VERSION"):
        if name in os.environ:
            lines.append(f'export {name}="{os.environ[name]}"')
    path = tmp_path / "setup.bash"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def environment(setup: Path, tmp_path: Path, domain_id: int) -> dict[str, str]:
    """The variables of a service: no HOME, no user, no shell's."""
    if not (ROOT / "install" / "vergence_servo").is_dir():
        pytest.skip("the workspace is not built in this folder")
    return {
        "PATH": "/usr/local/bin:/usr/bin:/bin",
        "WORKSPACE": str(ROOT),
        "ROS_SETUP": str(setup),
        "SERVOS": str(ROOT / "config" / "servos.yaml"),
        "BACKEND": "fake",
        "ROS_DOMAIN_ID": str(domain_id),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


def run(environment: dict[str, str]) -> "subprocess.Popen[str]":
    command = ["bash", str(FOLDER / "run_servo_node")]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def test_the_script_runs_the_node_and_ends_it_cleanly(environment: dict[str, str], tmp_path: Path) -> None:
    with run(environment | {"ROS_HOME": str(tmp_path / "state")}) as process:
        assert process.stderr is not None
        lines = []
        for line in process.stderr:
            lines.append(line)
            if "no servo moves" in line:
                process.send_signal(signal.SIGTERM)
    assert process.returncode == 0, lines
    assert (tmp_path / "state" / "log").is_dir()


@pytest.mark.parametrize("missing", ["WORKSPACE", "SERVOS"])
def test_a_variable_that_is_missing_is_named(environment: dict[str, str], missing: str) -> None:
    process = run({name: value for name, value in environment.items() if name != missing})
    _, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode != 0
    assert f"{missing}: must be" in errors


def test_a_node_without_any_home_starts(environment: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even ROS_HOME: the logs go to the user's own folder."""
    servos = environment | {"SERVOS": "/nowhere/servos.yaml"}
    process = run(servos)
    _, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 2
    assert "/nowhere/servos.yaml" in errors
    assert "logging" not in errors
