"""pi.launch.py: a crash is followed by a new start, a configuration that is refused is not."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytestmark = pytest.mark.system

pytest.importorskip("launch_ros", reason="launch is not installed here (it comes with ROS from apt)")

ROOT = Path(__file__).parents[2]
LAUNCH_FILE = ROOT / "src" / "vergence_bringup" / "launch" / "pi.launch.py"
PATIENCE_S = 90.0
# As `ros2 launch` does, which needs ros2cli besides.
RUN = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

arguments = dict(text.split(":=", 1) for text in sys.argv[2:])
service = LaunchService()
included = IncludeLaunchDescription(PythonLaunchDescriptionSource(sys.argv[1]), launch_arguments=arguments.items())
service.include_launch_description(LaunchDescription([included]))
sys.exit(service.run())
"""


class Launch:
    """pi.launch.py, running."""

    def __init__(self, folder: Path, **values: object) -> None:
        values = {"servos": ROOT / "config" / "servos.yaml", "discovery_range": "LOCALHOST"} | values
        argv = [sys.executable, "-c", RUN, str(LAUNCH_FILE), *(f"{name}:={value}" for name, value in values.items())]
        self._said = folder / "said"
        with self._said.open("wb") as output:
            self.process = subprocess.Popen(argv, stdout=output, stderr=output, start_new_session=True)

    @property
    def said(self) -> str:
        return self._said.read_text()

    @property
    def servo_node(self) -> int | None:
        """The process that it runs now, if it does."""
        tasks = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        children = tasks.read_text().split()
        return int(children[0]) if children else None

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()


Start = Callable[..., Launch]


@pytest.fixture
def start(domain_id: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    running: list[Launch] = []

    def run(**values: object) -> Launch:
        running.append(Launch(tmp_path, **values))
        return running[-1]

    yield run
    for launch in running:
        launch.close()


def wait_for(condition: Callable[[], bool], what: str) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline_s, f"never: {what}"
        time.sleep(0.02)


@pytest.mark.parametrize(("name", "value"), [("backend", "gpiozero"), ("servos", "/nowhere/servos.yaml")])
def test_wrong_arguments_end_the_launch_before_servo_node_starts(start: Start, name: str, value: str) -> None:
    launch = start(**{"backend": "fake", name: value})
    assert launch.process.wait(PATIENCE_S) == 1
    assert "process started" not in launch.said
    assert "pi.launch.py starts nothing" in launch.said


def test_a_configuration_that_servo_node_refuses_ends_the_launch(start: Start, tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("baseline_m: wide\n")
    launch = start(backend="fake", rig=tmp_path / "rig.yaml")
    assert launch.process.wait(PATIENCE_S) == 0
    assert launch.said.count("process started") == 1
    assert "exit code 2" in launch.said
    assert "servo_node ended (it could not start)" in launch.said


def test_a_crash_is_followed_by_a_new_start_and_a_clean_end_is_the_end(start: Start) -> None:
    launch = start(backend="fake")
    wait_for(lambda: launch.said.count("no servo moves") == 1, "servo_node runs")
    first = launch.servo_node
    assert first is not None
    os.kill(first, signal.SIGKILL)
    wait_for(lambda: launch.said.count("no servo moves") == 2, "servo_node runs again")
    second = launch.servo_node
    assert second is not None
    assert second != first
    os.kill(second, signal.SIGTERM)
    assert launch.process.wait(PATIENCE_S) == 0
    assert launch.said.count("process started") == 2
