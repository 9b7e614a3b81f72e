"""A laptop and a Pi: two network namespaces joined by a cable that can be pulled, real processes on both sides."""

import json
import math
import os
import select
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vergence_rig.rig import default_rig
from vergence_rig.testing.ideal_eyes import gaze_for_point

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

CONFIG = Path(__file__).parents[2] / "config"
PATIENCE_S = 90.0
LEFT_M, RIGHT_M = (0.6, 0.25, 0.05), (0.5, -0.15, -0.05)
NEAR_US = 8.0


def attribute(path: Path) -> int:
    """Read a number that may just be being written: a file, unlike sysfs, is empty for that moment."""
    while not (text := path.read_text().strip()):
        time.sleep(0.001)
    return int(text)


class Machines:
    """Processes on both machines, and the wires of the Pi's servos."""

    def __init__(self, cable: Any, folder: Path) -> None:
        self.cable = cable
        self.duty = folder / "pwmchip0" / "pwm0" / "duty_cycle"
        for number in range(3):
            channel = folder / "pwmchip0" / f"pwm{number}"
            channel.mkdir(parents=True)
            for name in ("duty_cycle", "period", "enable"):
                (channel / name).write_text("0\n")
        (folder / "pwmchip0" / "npwm").write_text("3\n")
        self._folder = folder
        self._running: list[subprocess.Popen[str]] = []
        self._pipes: list[int] = []

    def pipe(self) -> Path:
        """Make a pipe of duty_cycle, so that a reader hears of every pulse at once."""
        self.duty.unlink()
        os.mkfifo(self.duty)
        self._pipes.append(os.open(self.duty, os.O_RDWR))  # kept open: the node must not wait for a reader
        return self.duty

    def servo_node(self, **values: object) -> "subprocess.Popen[str]":
        values = {
            "backend": "kernel_pwm",
            "kernel_pwm.root": self._folder,
            "servos": CONFIG / "servos.yaml",
            "pose_file": self._folder / "pose.json",
        } | values
        argv = ["-m", "vergence_servo.ros.servo_node", "--ros-args", "--params-file", str(CONFIG / "servo_node.yaml")]
        argv += [part for name, value in values.items() for part in ("-p", f"{name}:={value}")]
        return self._run(self.cable.pi, argv)

    def controller(self) -> "subprocess.Popen[str]":
        argv = ["-m", "vergence_gaze.ros.gaze_controller_node", "--ros-args"]
        return self._run(self.cable.laptop, [*argv, "--params-file", str(CONFIG / "gaze_controller_node.yaml")])

    def target(self, place_m: tuple[float, float, float]) -> "subprocess.Popen[str]":
        """Publish a gaze target on the laptop."""
        return self._script("gaze_target.py", *map(str, place_m))

    def commander(self, *arguments: str) -> "subprocess.Popen[str]":
        return self._script("joint_commander.py", *arguments)

    def _script(self, name: str, *arguments: str) -> "subprocess.Popen[str]":
        return self._run(self.cable.laptop, [str(Path(__file__).with_name(name)), *arguments])

    def kill(self, process: "subprocess.Popen[str]") -> None:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=PATIENCE_S)

    def _run(self, namespace: str, argv: list[str]) -> "subprocess.Popen[str]":
        env = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
        command = ["ip", "netns", "exec", namespace, sys.executable, *argv]
        process = subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True, start_new_session=True)
        self._running.append(process)
        return process

    def pulse_us(self) -> float:
        duty_ns, enabled = (attribute(path) for path in (self.duty, self.duty.with_name("enable")))
        return duty_ns / 1000 if enabled else 0.0

    def pulses_until_released(self) -> set[float]:
        """Return every pulse seen until there is none [us]."""
        seen: set[float] = set()

        def released() -> bool:
            seen.add(self.pulse_us())
            return 0.0 in seen

        self.until(released, "the servo is released")
        return seen - {0.0}

    def until(self, condition: Callable[[], bool], what: str) -> float:
        started_s = time.monotonic()
        while not condition():
            assert time.monotonic() - started_s < PATIENCE_S, f"never: {what}"
            time.sleep(0.01)
        return time.monotonic() - started_s

    def close(self) -> None:
        for process in self._running:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
        for process in self._running:
            try:
                process.communicate(timeout=30)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate(timeout=30)
        for pipe in self._pipes:
            os.close(pipe)


@pytest.fixture
def machines(cable: Any, tmp_path: Path, domain_id: int) -> Iterator[Machines]:
    both = Machines(cable, tmp_path)
    yield both
    both.close()


def line(process: "subprocess.Popen[str]") -> dict[str, object]:
    assert process.stdout is not None
    assert select.select([process.stdout], [], [], PATIENCE_S)[0], "the commander says nothing"
    return dict(json.loads(process.stdout.readline()))


def pulse_towards(place_m: tuple[float, float, float]) -> object:
    """The left eye's pulse when it looks at a point of rig_base, as nearly as an SG90's dead band lets one ask [us]."""
    angle_rad = gaze_for_point(np.array(place_m), default_rig().baseline_m).pan_left_rad
    return pytest.approx(1500.0 + math.degrees(angle_rad) / 0.09, abs=NEAR_US)


def test_discovery_and_latency_across_the_cable(machines: Machines, record_property: Callable[[str, object], None]):
    pipe = machines.pipe()
    machines.servo_node()
    commander = machines.commander("latency", str(pipe), "50")
    matched_s = line(commander)["matched_s"]
    latencies_ms = line(commander)["latencies_ms"]
    assert isinstance(latencies_ms, list)
    assert len(latencies_ms) == 50
    record_property("matched_s", matched_s)
    record_property("latency_median_ms", statistics.median(latencies_ms))
    print(
        f"matched after {matched_s} s, median {statistics.median(latencies_ms):.2f} ms, max {max(latencies_ms):.2f} ms"
    )


def test_a_pulled_cable_holds_then_releases_then_resumes(machines: Machines):
    machines.servo_node(command_timeout_s=0.5, release_timeout_s=2.0)
    machines.controller()
    machines.target(LEFT_M)
    machines.until(lambda: machines.pulse_us() == pulse_towards(LEFT_M), "the servo follows the controller")
    pulled_s = time.monotonic()
    machines.cable.pull()
    held_us = machines.pulses_until_released()
    assert time.monotonic() - pulled_s > 1.5
    assert all(pulse == pulse_towards(LEFT_M) for pulse in held_us)
    machines.cable.plug()
    machines.until(lambda: machines.pulse_us() == pulse_towards(LEFT_M), "the servo resumes")


def test_a_killed_controller_is_held_for_and_a_restarted_one_takes_over(machines: Machines):
    machines.servo_node(command_timeout_s=0.5, release_timeout_s=2.0)
    target = machines.target(LEFT_M)
    controller = machines.controller()
    machines.until(lambda: machines.pulse_us() == pulse_towards(LEFT_M), "the servo follows the first controller")
    killed_s = time.monotonic()
    machines.kill(controller)
    held_us = machines.pulses_until_released()
    assert time.monotonic() - killed_s > 1.5
    assert all(pulse == pulse_towards(LEFT_M) for pulse in held_us)
    machines.kill(target)
    target = machines.target(RIGHT_M)
    controller = machines.controller()
    machines.until(lambda: machines.pulse_us() == pulse_towards(RIGHT_M), "the servo follows the restarted controller")
    for process in (controller, target):  # again, and now it is back before anything times out
        machines.kill(process)
    machines.controller()
    machines.target(LEFT_M)
    machines.until(lambda: machines.pulse_us() == pulse_towards(LEFT_M), "the servo follows the third controller")
