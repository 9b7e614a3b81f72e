"""servo_node as a process with the shipped YAML: parks on signals, leaves nothing pulsing, refuses broken YAML."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from vergence_servo.testing.pigpio_daemon import PigpioDaemon

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "config"
PATIENCE_S = 90.0


def wait_for(condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> None:
    deadline_s = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline_s, f"never: {what}"
        time.sleep(0.01)


def attribute(path: Path) -> int:
    """Read a number that may just be being written: a file, unlike sysfs, is empty for that moment."""
    while not (text := path.read_text().strip()):
        time.sleep(0.001)
    return int(text)


class Wires:
    """A PWM chip in a folder."""

    def __init__(self, root: Path) -> None:
        self.root = root
        for number in range(3):
            folder = root / "pwmchip0" / f"pwm{number}"
            folder.mkdir(parents=True)
            for name in ("duty_cycle", "period", "enable"):
                (folder / name).write_text("0\n")
        (root / "pwmchip0" / "npwm").write_text("3\n")

    def pulse_us(self, channel: int) -> float:
        folder = self.root / "pwmchip0" / f"pwm{channel}"
        duty_ns, enabled = (attribute(folder / name) for name in ("duty_cycle", "enable"))
        return duty_ns / 1000 if enabled else 0.0

    def tap(self, channel: int) -> int:
        """Return a descriptor from which every width [ns] that is written to a channel from now on can be read."""
        pipe = self.root / f"tap{channel}"
        os.mkfifo(pipe)
        reader = os.open(pipe, os.O_RDWR)
        pipe.replace(self.root / "pwmchip0" / f"pwm{channel}" / "duty_cycle")
        return reader


@pytest.fixture
def wires(tmp_path: Path) -> Wires:
    return Wires(tmp_path / "pwm")


Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(wires: Wires, tmp_path: Path, domain_id: int) -> Iterator[Start]:
    running: list[subprocess.Popen[str]] = []

    def run(*argv: str) -> "subprocess.Popen[str]":
        process = subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        running.append(process)
        return process

    yield run
    for process in running:
        if process.poll() is None:
            process.kill()
        process.communicate()


def servo_argv(wires: Wires, *more: str) -> list[str]:
    return [
        *(sys.executable, "-m", "vergence_servo.ros.servo_node", "--ros-args"),
        *("--params-file", str(CONFIG / "servo_node.yaml"), "-p", "backend:=kernel_pwm"),
        *("-p", f"kernel_pwm.root:={wires.root}", "-p", f"servos:={CONFIG / 'servos.yaml'}"),
        *("-p", f"pose_file:={wires.root / 'pose.json'}", *more),
    ]


def commander_argv(*arguments: str) -> list[str]:
    return [sys.executable, str(Path(__file__).with_name("joint_commander.py")), *arguments]


def moving_node(start: Start, wires: Wires, *more: str) -> "subprocess.Popen[str]":
    node = start(*servo_argv(wires, *more))
    commander = start(*commander_argv("steady", "0.5"))
    wait_for(lambda: wires.pulse_us(0) == pytest.approx(1818.3, abs=0.1), "the servo follows")
    commander.send_signal(signal.SIGKILL)
    return node


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_park_and_release(start: Start, wires: Wires, number: int):
    values = ("park_rad:=[0.1,0.0,0.0]", "release_timeout_s:=0.0", "park_time_limit_s:=30.0")
    node = moving_node(start, wires, *(part for value in values for part in ("-p", value)))
    tap = wires.tap(0)
    node.send_signal(number)
    node.wait(PATIENCE_S)
    written_us = [int(text) / 1000 for text in os.read(tap, 1 << 16).split()]
    os.close(tap)
    assert node.returncode == 0
    assert [wires.pulse_us(channel) for channel in (1, 2)] == [0.0] * 2
    # Down to 0.1 rad at no more than park_speed_rad_s, in steps of a pulse period at most; then silence.
    *way_us, last_us = written_us
    steps_us = -np.diff(way_us)
    assert last_us == 0.0
    assert way_us[-1] == pytest.approx(1563.66, abs=0.1)
    assert len(way_us) >= 5
    assert steps_us.min() > 0.0
    assert steps_us.max() <= math.degrees(1.5 * 0.02) / 0.09 + 0.1
    assert json.loads((wires.root / "pose.json").read_text())["pan_left"] == pytest.approx(0.1, abs=1e-3)


def test_the_guardian_releases_what_a_killed_node_leaves(start: Start, wires: Wires):
    node = moving_node(start, wires, "-p", "release_timeout_s:=0.0")
    node.send_signal(signal.SIGKILL)
    wait_for(lambda: wires.pulse_us(0) == 0.0, "the guardian releases")


def test_the_guardian_releases_what_a_stopped_node_leaves_and_the_node_goes_on_later(start: Start, wires: Wires):
    node = moving_node(start, wires, "-p", "release_timeout_s:=0.0", "-p", "guardian_timeout_s:=0.5")
    node.send_signal(signal.SIGSTOP)
    wait_for(lambda: wires.pulse_us(0) == 0.0, "the guardian releases")
    node.send_signal(signal.SIGCONT)
    assert node.stderr is not None
    assert any("its guardian has released the servos" in line for line in node.stderr)
    assert wires.pulse_us(0) == 0.0
    commander = start(*commander_argv("steady", "0.5"))
    wait_for(lambda: wires.pulse_us(0) > 0.0, "the servo starts again")
    commander.send_signal(signal.SIGKILL)
    node.send_signal(signal.SIGSTOP)
    wait_for(lambda: wires.pulse_us(0) == 0.0, "the guardian releases again")
    node.send_signal(signal.SIGCONT)


def test_a_stopped_node_loses_the_pulses_of_a_daemon_too(start: Start, wires: Wires, tmp_path: Path):
    daemon = PigpioDaemon()
    path = tmp_path / "servos.yaml"
    path.write_text("servos: {tilt: {channel: 17}}\n")
    more = (
        "servos:=" + str(path),
        "backend:=pigpio",
        f"pigpio.port:={daemon.port}",
        "joints:=[tilt]",
        "park_rad:=[0.0]",
    )
    try:
        node = start(*servo_argv(wires, *(part for value in more for part in ("-p", value))))
        commander = start(*commander_argv("steady", "0.2", "tilt"))
        wait_for(lambda: daemon.pulses.get(17, 0) > 0, "the servo is driven")
        node.send_signal(signal.SIGSTOP)
        wait_for(lambda: daemon.pulses[17] == 0, "the guardian releases")
        commander.send_signal(signal.SIGKILL)
        node.send_signal(signal.SIGCONT)
    finally:
        daemon.close()


def test_every_backend_that_pulses_on_has_a_guardian(start: Start, wires: Wires, tmp_path: Path):
    daemon = PigpioDaemon()
    path = tmp_path / "servos.yaml"
    path.write_text("servos: {pan_left: {channel: 0}, tilt: {channel: 17, backend: pigpio}}\n")
    more = ("servos:=" + str(path), f"pigpio.port:={daemon.port}", "joints:=[pan_left,tilt]", "park_rad:=[0.0,0.0]")
    try:
        node = start(*servo_argv(wires, *(part for value in more for part in ("-p", value))))
        commander = start(*commander_argv("steady", "0.2", "pan_left", "tilt"))
        wait_for(lambda: wires.pulse_us(0) > 0 and daemon.pulses.get(17, 0) > 0, "both servos are driven")
        commander.send_signal(signal.SIGKILL)
        node.send_signal(signal.SIGKILL)
        wait_for(lambda: wires.pulse_us(0) == 0.0 and daemon.pulses[17] == 0, "the guardians release both")
    finally:
        daemon.close()


def test_without_a_guardian_hardware_goes_on_pulsing_and_the_next_start_stops_it(start: Start, wires: Wires):
    node = moving_node(start, wires, "-p", "release_timeout_s:=0.0", "-p", "guardian:=false")
    node.send_signal(signal.SIGKILL)
    node.wait(PATIENCE_S)
    time.sleep(0.5)
    assert wires.pulse_us(0) > 0
    start(*servo_argv(wires))
    wait_for(lambda: wires.pulse_us(0) == 0.0, "the next node releases")


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("servo_node: {ros__parameters: {stagger_s: -1.0}}", "stagger_s"),
        ("servo_node: {ros__parameters: {staggr_s: 1.0}}", "staggr_s"),
        ("servo_node: {ros__parameters: {backend: gpiozero}}", "11 positions"),
        ("servo_node: [", ""),
    ],
)
def test_broken_yaml_ends_it_with_one_line(start: Start, tmp_path: Path, text: str, complaint: str):
    path = tmp_path / "broken.yaml"
    path.write_text(text + "\n")
    node = start(sys.executable, "-m", "vergence_servo.ros.servo_node", "--ros-args", "--params-file", str(path))
    _, errors = node.communicate(timeout=PATIENCE_S)
    assert node.returncode == 2
    assert complaint in errors
    assert "Traceback" not in errors


def test_a_bare_start_is_the_fake_and_says_so(start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    node = start(sys.executable, "-m", "vergence_servo.ros.servo_node")
    assert node.stderr is not None
    assert any("no servo moves" in line for line in node.stderr)
    node.send_signal(signal.SIGINT)
    node.communicate(timeout=PATIENCE_S)
    assert node.returncode == 0
