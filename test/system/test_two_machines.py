"""A laptop and a Pi: two network namespaces joined by a cable that can be pulled, real processes on both sides."""

import json
import os
import shutil
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytestmark = [pytest.mark.system, pytest.mark.timeout(180)]

CONFIG = Path(__file__).parents[2] / "config"
PATIENCE_S = 40.0


def ip(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(["ip", *arguments], capture_output=True, text=True, timeout=10)


class Cable:
    """Two namespaces, `laptop` and `pi`, each with one end of a veth pair."""

    def __init__(self) -> None:
        self.name = f"vg{os.getpid()}"
        self.laptop, self.pi = f"{self.name}_laptop", f"{self.name}_pi"

    def lay(self) -> None:
        """Make the namespaces and join them. Raises OSError where this machine does not allow it."""
        ends = ((self.laptop, f"{self.name}l", "10.98.76.1/24"), (self.pi, f"{self.name}p", "10.98.76.2/24"))
        for namespace, _, _ in ends:
            self._do("netns", "add", namespace)
        self._do("link", "add", ends[0][1], "netns", self.laptop, "type", "veth", "peer", ends[1][1], "netns", self.pi)
        for namespace, link, address in ends:
            self._do("-n", namespace, "addr", "add", address, "dev", link)
            self._do("-n", namespace, "link", "set", "lo", "up")
            self._do("-n", namespace, "link", "set", link, "up", "multicast", "on")
            self._do("-n", namespace, "route", "add", "224.0.0.0/4", "dev", link)

    def pull(self) -> None:
        self._do("-n", self.laptop, "link", "set", f"{self.name}l", "down")

    def plug(self) -> None:
        self._do("-n", self.laptop, "link", "set", f"{self.name}l", "up")
        self._do("-n", self.laptop, "route", "replace", "224.0.0.0/4", "dev", f"{self.name}l")

    def remove(self) -> None:
        for namespace in (self.laptop, self.pi):
            ip("netns", "del", namespace)

    def _do(self, *arguments: str) -> None:
        done = ip(*arguments)
        if done.returncode:
            raise OSError(f"ip {' '.join(arguments)}: {done.stderr.strip()}")


@pytest.fixture
def cable() -> Iterator[Cable]:
    if os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("network namespaces need root and the ip command")
    made = Cable()
    try:
        try:
            made.lay()
        except OSError as error:
            pytest.skip(f"this machine gives no network namespaces: {error}")
        yield made
    finally:
        made.remove()


class Machines:
    """Processes on both machines, and the wires of the Pi's servos."""

    def __init__(self, cable: Cable, folder: Path) -> None:
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
        argv = ["-m", "vergence_servo.servo_node", "--ros-args", "--params-file", str(CONFIG / "servo_node.yaml")]
        argv += [part for name, value in values.items() for part in ("-p", f"{name}:={value}")]
        return self._run(self.cable.pi, argv)

    def controller(self, *arguments: str) -> "subprocess.Popen[str]":
        return self._run(self.cable.laptop, [str(Path(__file__).with_name("joint_commander.py")), *arguments])

    def _run(self, namespace: str, argv: list[str]) -> "subprocess.Popen[str]":
        env = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
        command = ["ip", "netns", "exec", namespace, sys.executable, *argv]
        process = subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True, start_new_session=True)
        self._running.append(process)
        return process

    def pulse_us(self) -> float:
        duty, enabled = (path.read_text().split() for path in (self.duty, self.duty.with_name("enable")))
        return int(duty[0]) / 1000 if duty and enabled == ["1"] else 0.0

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
                process.communicate(timeout=10)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate(timeout=10)
        for pipe in self._pipes:
            os.close(pipe)


@pytest.fixture
def machines(cable: Cable, tmp_path: Path, domain_id: int) -> Iterator[Machines]:
    both = Machines(cable, tmp_path)
    yield both
    both.close()


def line(process: "subprocess.Popen[str]") -> dict[str, object]:
    assert process.stdout is not None
    return dict(json.loads(process.stdout.readline()))


def test_discovery_and_latency_across_the_cable(machines: Machines, record_property: Callable[[str, object], None]):
    pipe = machines.pipe()
    machines.servo_node()
    controller = machines.controller("latency", str(pipe), "50")
    matched_s = line(controller)["matched_s"]
    latencies_ms = line(controller)["latencies_ms"]
    assert isinstance(latencies_ms, list)
    assert len(latencies_ms) == 50
    record_property("matched_s", matched_s)
    record_property("latency_median_ms", statistics.median(latencies_ms))
    print(
        f"matched after {matched_s} s, median {statistics.median(latencies_ms):.2f} ms, max {max(latencies_ms):.2f} ms"
    )


def test_a_pulled_cable_holds_then_releases_then_resumes(machines: Machines):
    machines.servo_node(command_timeout_s=0.5, release_timeout_s=1.5)
    controller = machines.controller("steady", "0.5")
    line(controller)
    machines.until(lambda: machines.pulse_us() == pytest.approx(1818.3, abs=0.1), "the servo follows")
    machines.cable.pull()
    pulled_s = time.monotonic()
    while time.monotonic() - pulled_s < 1.5:
        assert machines.pulse_us() == pytest.approx(1818.3, abs=0.1)  # held
        time.sleep(0.05)
    machines.until(lambda: machines.pulse_us() == 0.0, "the servo is released")
    machines.cable.plug()
    machines.until(lambda: machines.pulse_us() == pytest.approx(1818.3, abs=0.1), "the servo resumes")


def test_a_killed_controller_is_replaced(machines: Machines):
    machines.servo_node(command_timeout_s=0.3, release_timeout_s=60.0)
    first = machines.controller("steady", "0.5")
    machines.until(lambda: machines.pulse_us() == pytest.approx(1818.3, abs=0.1), "the servo follows the first")
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    time.sleep(0.6)
    assert machines.pulse_us() == pytest.approx(1818.3, abs=0.1)
    machines.controller("steady", "-0.2")
    machines.until(lambda: machines.pulse_us() == pytest.approx(1372.68, abs=0.1), "the servo follows the second")
