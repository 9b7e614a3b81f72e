"""Servos: from a command on a topic to a pulse written, hostile commands, and what each backend's steps cost.

Latency: servo_node is a process of its own and drives the kernel PWM backend; the channel's duty_cycle is a pipe, so
that this process reads the pulse when the node writes it. Measured from before publish() to after the read.
"""

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import JointState

from bench.results import Row
from vergence_common.domains import own_domain
from vergence_rig.rig import default_rig
from vergence_servo.calibration import ServoLimits, default_servos, servo_limits
from vergence_servo.command_guard import CommandRefusedError, StampGuard, StampLimits, named_positions
from vergence_servo.drivers.fake import FakeDriver, FakeParameters
from vergence_servo.drivers.protocol import DriverIoError
from vergence_servo.safety import grid_ends, safe_pulse_us
from vergence_servo.servo_channel import RetryParameters
from vergence_servo.servo_head import HeadParameters, ServoHead

COMMANDS = 1000
RATE_HZ = 100.0
HOSTILE_COMMANDS = 100_000
GPIOZERO_POSITIONS = 11
CONFIG = Path(__file__).resolve().parent.parent / "config"

# The grid of each backend [us], as its driver reports it.
GRIDS_US = {"kernel_pwm": 0.02, "pca9685": 122 / 25.0, "pigpio": 5.0, "lgpio": 1.0, "fake": 1.0}


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure everything."""
    latency_ms = _latency_ms()
    say(f"{len(latency_ms)} commands at {RATE_HZ:g} Hz, longest {latency_ms.max():.2f} ms")
    violations, taken, written = hostile_violations(HOSTILE_COMMANDS)
    say(f"{HOSTILE_COMMANDS} hostile commands: {taken} taken, {written} pulses written, {violations} violations")
    if not written:
        raise RuntimeError("no hostile command led to a pulse: nothing was tested")
    peer_deg = _gpiozero_error_deg()
    return [
        Row("servo.latency_median_ms", float(np.median(latency_ms)), "ms"),
        Row("servo.latency_p99_ms", float(np.percentile(latency_ms, 99)), "ms"),
        Row("servo.hostile_violations", violations, "pulses"),
        *(
            Row(f"servo.resolution_deg.{name}", _worst_error_deg(grid_us), "deg", "gpiozero over lgpio", peer_deg)
            for name, grid_us in GRIDS_US.items()
        ),
    ]


# ---- latency


def _latency_ms() -> "np.ndarray":
    with tempfile.TemporaryDirectory() as folder, own_domain() as domain, _piped_node(Path(folder), domain) as pipe:
        context = Context()
        rclpy.init(context=context, domain_id=domain)
        node = Node("commander", context=context)
        publisher = node.create_publisher(JointState, "joint_command", 10)
        deadline_s = time.monotonic() + 30
        while publisher.get_subscription_count() < 1:
            if time.monotonic() > deadline_s:
                raise RuntimeError("servo_node was not discovered within 30 s")
            time.sleep(0.05)
        try:
            _one(publisher, node, pipe, 0.0)  # the first pulse also prepares the channel
            time.sleep(0.2)
            return np.array([_one(publisher, node, pipe, 0.002 * (1 + i % 5)) for i in range(COMMANDS)])
        finally:
            node.destroy_node()
            context.try_shutdown()


def _one(publisher: "rclpy.publisher.Publisher", node: Node, pipe: int, angle_rad: float) -> float:
    time.sleep(1.0 / RATE_HZ)
    _drain(pipe)
    message = JointState(name=["pan_left"], position=[angle_rad])
    message.header.stamp = node.get_clock().now().to_msg()
    os.set_blocking(pipe, True)
    started_ns = time.monotonic_ns()
    publisher.publish(message)
    os.read(pipe, 64)
    return (time.monotonic_ns() - started_ns) * 1e-6


def _drain(pipe: int) -> None:
    os.set_blocking(pipe, False)
    try:
        while os.read(pipe, 4096):
            pass
    except BlockingIOError:
        return


@contextmanager
def _piped_node(root: Path, domain: int) -> Iterator[int]:
    for number in range(3):
        folder = root / "pwmchip0" / f"pwm{number}"
        folder.mkdir(parents=True)
        for name in ("duty_cycle", "period", "enable"):
            (folder / name).write_text("0\n")
    (root / "pwmchip0" / "npwm").write_text("3\n")
    duty = root / "pwmchip0" / "pwm0" / "duty_cycle"
    duty.unlink()
    os.mkfifo(duty)
    pipe = os.open(duty, os.O_RDWR)
    values = {
        "backend": "kernel_pwm",
        "kernel_pwm.root": root,
        "servos": CONFIG / "servos.yaml",
        "pose_file": root / "pose.json",
    }
    argv = [sys.executable, "-m", "vergence_servo.ros.servo_node", "--ros-args"]
    argv += ["--params-file", str(CONFIG / "servo_node.yaml")]
    argv += [part for name, value in values.items() for part in ("-p", f"{name}:={value}")]
    process = subprocess.Popen(argv, env=os.environ | {"ROS_DOMAIN_ID": str(domain)})
    try:
        yield pipe
    finally:
        process.terminate()
        status = process.wait(15)
        os.close(pipe)
        if status:
            raise RuntimeError(f"servo_node ended with status {status}")


# ---- hostile commands


class _Watched(FakeDriver):
    """The shipped fake driver; checks every pulse against the limits, on any grid, with occasional failures."""

    def __init__(self, limits: dict[int, ServoLimits], resolution_us: float, random: np.random.Generator) -> None:
        self.now_s = 1000.0
        super().__init__(FakeParameters(resolution_us=resolution_us), clock=lambda: self.now_s)
        self.violations = self.written = 0
        self._limits, self._random = limits, random
        self._last: dict[int, tuple[float, float]] = {}

    def set_pulse_us(self, channel: int, pulse_us: float) -> float:
        if self._random.random() < 0.002:
            raise DriverIoError(121, "Remote I/O error")
        limits = self._limits[channel]
        safe = math.isfinite(pulse_us) and limits.minimum_us <= pulse_us <= limits.maximum_us
        if safe and channel in self._last:
            last_s, last_us = self._last[channel]
            way_rad = abs(limits.calibration.joint_rad(pulse_us) - limits.calibration.joint_rad(last_us))
            safe = way_rad <= limits.max_speed_rad_s * max(self.now_s - last_s, 0.0) + 1e-9
        self.violations += not safe
        self.written += 1
        self._last[channel] = (self.now_s, pulse_us)
        return super().set_pulse_us(channel, pulse_us)


def hostile_violations(count: int) -> tuple[int, int, int]:
    """Send `count` hostile commands; return (unsafe pulses, commands taken, pulses written)."""
    random = np.random.default_rng(7)
    rig = default_rig()
    limits = {name: servo_limits(name, servo, rig.joints[name]) for name, servo in default_servos().items()}
    by_channel = {limit.calibration.channel: limit for limit in limits.values()}
    violations = taken = written = 0
    parameters = HeadParameters(stagger_s=0.01, release_timeout_s=1.0)
    retry = RetryParameters(first_s=0.02, longest_s=0.1)
    for grid_us in GRIDS_US.values():
        wires = _Watched(by_channel, grid_us, random)
        head = ServoHead(wires, limits, parameters, {"tilt": float(random.uniform(-9, 9))}, wires.now_s, retry)
        stamps = StampGuard(StampLimits(0.5, 0.1, 0.5))
        for _ in range(count // len(GRIDS_US)):
            wires.now_s += _pause_s(random)
            taken += _attempt(head, stamps, wires.now_s, random)
            head.step(wires.now_s)
        violations, written = violations + wires.violations, written + wires.written
    return violations, taken, written


def _pause_s(random: np.random.Generator) -> float:
    kind = random.integers(20)
    if kind == 0:
        return float(random.uniform(0, 3))
    return float(random.uniform(-0.01, 0)) if kind == 1 else float(random.exponential(0.005))


def _attempt(head: ServoHead, stamps: StampGuard, now_s: float, random: np.random.Generator) -> int:
    """Send one hostile command, past the guard half of the time; return 1 if it was taken."""
    pool = ["pan_left", "pan_right", "tilt", "pan_left", "tilt", "", "neck", "PAN_LEFT"]
    names = [str(name) for name in random.choice(pool, random.integers(0, 4))]
    positions = [_hostile_angle(random) for _ in range(len(names) + int(random.integers(8) == 0))]
    act = random.integers(60)
    try:
        if act == 0:
            head.enable(bool(random.integers(2)), now_s)
        elif act == 1:
            head.park(now_s)
        elif act == 2:
            head.release(now_s)
        elif act < 30:
            stamps.check(int((now_s + random.choice([0, 0, 0, -1e-4, -2, 5, -900])) * 1e9), int(now_s * 1e9))
            head.command(named_positions(names, positions, tuple(head.channels)), now_s)
        else:  # bypasses the command guard
            head.command(dict(zip(names, positions, strict=False)), now_s)
    except CommandRefusedError:
        if act == 0:
            head.enable(True, now_s)
        return 0
    if random.integers(10) == 0:
        head.enable(True, now_s)
    return 1


def _hostile_angle(random: np.random.Generator) -> float:
    kinds = (math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, -0.0)
    kind = int(random.integers(24))
    return kinds[kind] if kind < len(kinds) else float(random.uniform(-4, 4))


# ---- resolution


def _worst_error_deg(grid_us: float) -> float:
    """Largest angle between what is wanted of an SG90 and the pulse that the head settles on, within its range."""
    servo = default_servos()["pan_left"]
    limits = servo_limits("pan_left", servo)
    first, last = grid_ends(limits, grid_us)
    wanted_rad = np.linspace(servo.joint_rad(first * grid_us), servo.joint_rad(last * grid_us), 20001)
    sent_us = [
        safe_pulse_us(float(angle), 1500.0, 1e9, replace(limits, max_speed_rad_s=1e9), grid_us) for angle in wanted_rad
    ]
    error_rad = [servo.joint_rad(pulse) - angle for pulse, angle in zip(sent_us, wanted_rad, strict=True)]
    return float(np.degrees(np.abs(error_rad).max()))


def _gpiozero_error_deg() -> float:
    """The same for duty cycles in whole percent of 20 ms, 200 us apart, of which a servo's range holds 11."""
    servo = default_servos()["pan_left"]
    positions_us = 500 + 200.0 * np.arange(GPIOZERO_POSITIONS)
    wanted_us = np.linspace(positions_us[0], positions_us[-1], 20001)
    nearest = positions_us[np.abs(wanted_us[:, None] - positions_us).argmin(axis=1)]
    return float(np.degrees(np.abs(nearest - wanted_us).max() * servo.step_rad(1.0)))
