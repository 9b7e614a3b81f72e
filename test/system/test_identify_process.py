"""`vergence identify` on a running simulated head: its figures, a head that it refuses, and an end by Ctrl-C."""

import math
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from vergence_bringup.ros.processes import NodeCommand, ProcessGroup
from vergence_rig.rig_file import load_rig
from vergence_sim.printed_head import printed_head

pytestmark = [pytest.mark.system, pytest.mark.timeout(400), pytest.mark.usefixtures("opengl")]

SLOW_S = 0.12


@pytest.fixture
def processes(domain_id: int, tmp_path: Path) -> Iterator[ProcessGroup]:
    with ProcessGroup(tmp_path / "log") as group:
        yield group


def start_head(processes: ProcessGroup, *remappings: str, **head: Any) -> None:
    # Few frames a second: many tests may share this machine.
    parameters = {"servo_latency_s": SLOW_S, "camera.frame_rate_hz": 15.0, "head.model": "rolled"} | head
    processes.start("sim", NodeCommand.of("sim_node", parameters, remappings))


def identify(out: Path, *options: str) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "vergence_bringup.command_line", "identify", "--out", str(out), "--yes"]
    command += ["--timeout-s", "120"]
    return subprocess.Popen([*command, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_a_simulated_heads_latencies_and_gains_are_written(processes: ProcessGroup, tmp_path: Path) -> None:
    start_head(processes)
    out = tmp_path / "rig.yaml"
    out.write_text("baseline_m: 0.07\n")
    options = ("--only", "timing", "--rig", str(out), "--axes", "tilt", "--rest-s", "1.0", "--steps", "10")
    shown, errors = identify(out, *options).communicate(timeout=380)
    assert "wrote" in shown, shown + errors
    rig = load_rig(out)
    assert rig.baseline_m == 0.07
    assert len(list(tmp_path.glob("rig.yaml.*.bak"))) == 1
    record = yaml.safe_load(out.read_text())["identified"]
    axis = record["axes"]["tilt"]
    # on top of the servo's latency comes the way of the message, on a machine that may be busy
    assert SLOW_S - 0.02 < rig.joints.tilt.servo.command_latency_s < SLOW_S + 0.5
    # what hangs on stamps alone is as good as ever
    assert abs(axis["joint_states_late_s"]) < 4 * axis["joint_states_late_sigma_s"] + 0.005
    for eye in ("left", "right"):
        assert axis[f"{eye}_eye"]["focal_length_px"] == 539.0
        assert axis[f"{eye}_eye"]["px_per_rad"] == pytest.approx(539.0, rel=0.06)
    assert rig.pan_left == load_rig("").pan_left
    assert record["eyes"]["left"]["stamp_to_arrival_s"] > 0.044


def test_a_printed_heads_geometry_is_found_by_looking(processes: ProcessGroup, tmp_path: Path) -> None:
    start_head(
        processes, **{"head.model": "printed", "head.seed": 3, "head.camera_info": "none", "servo_latency_s": 0.015}
    )
    out = tmp_path / "rig.yaml"
    shown, errors = identify(out, "--only", "geometry", "--poses", "24").communicate(timeout=380)
    assert "wrote" in shown, shown + errors
    found, truth = load_rig(out).in_eye_angles(), printed_head(3).in_eye_angles()
    for left in (True, False):
        assert found.mount(left).lens_x_m == pytest.approx(truth.mount(left).lens_x_m, abs=0.002)
        assert found.mount(left).lens_y_m == pytest.approx(truth.mount(left).lens_y_m, abs=0.003)
        assert found.mount(left).roll_rad == pytest.approx(truth.mount(left).roll_rad, abs=math.radians(0.2))
        assert found.mount(left).pitch_rad == pytest.approx(truth.mount(left).pitch_rad, abs=math.radians(0.2))
        assert found.camera(left).fx_px == pytest.approx(truth.camera(left).fx_px, rel=0.01)
        assert found.camera(left).cx_px == pytest.approx(truth.camera(left).cx_px, abs=4)
    zeros = zip(load_rig(out).eye_angles((0, 0, 0))[:2], printed_head(3).eye_angles((0, 0, 0))[:2], strict=True)
    assert all(abs(own - true) < math.radians(0.3) for own, true in zeros)
    record = yaml.safe_load(out.read_text())["identified"]["geometry"]
    assert record["residual_px"] < 0.5 < 2.0 < record["residual_before_px"]


class Inverter(Node):
    """Turns the commands and reports of one joint round, as a servo that is mounted the other way would."""

    def __init__(self, context: Context) -> None:
        super().__init__("inverter", context=context)
        for topic, reply in (("joint_command", "inner_command"), ("inner_states", "joint_states")):
            publisher = self.create_publisher(JointState, reply, 10)
            self.create_subscription(JointState, topic, self._turned(publisher.publish), 10)

    @staticmethod
    def _turned(publish: Callable[[JointState], None]) -> Callable[[JointState], None]:
        def turn(message: JointState) -> None:
            message.position = [
                -angle if name == "pan_left" else angle
                for name, angle in zip(message.name, message.position, strict=True)
            ]
            publish(message)

        return turn


@pytest.fixture
def inverter(domain_id: int) -> Iterator[None]:
    context = Context()
    rclpy.init(context=context)
    node, executor = Inverter(context), SingleThreadedExecutor(context=context)
    executor.add_node(node)

    ending = threading.Event()

    def spin() -> None:
        try:
            while not ending.is_set():
                executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            return

    thread = threading.Thread(target=spin, daemon=True)
    thread.start()
    yield
    ending.set()  # first the thread: an executor that is shut down under it fails in the middle of its waiting
    thread.join(60)
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def test_a_servo_that_turns_the_wrong_way_is_refused(processes: ProcessGroup, tmp_path: Path, inverter: None) -> None:
    start_head(processes, "joint_command:=inner_command", "joint_states:=inner_states")
    out = tmp_path / "rig.yaml"
    process = identify(out, "--axes", "pan_left", "--rest-s", "0.5")
    shown, errors = process.communicate(timeout=380)
    assert process.returncode == 1, shown + errors
    assert "pan_left turns the wrong way" in errors
    assert "`sign: -1` for pan_left in servos.yaml" in errors
    assert "Traceback" not in errors
    assert not out.exists()


def reported(domain_id: int) -> dict[str, float]:
    """Return one message of joint_states."""
    context = Context()
    rclpy.init(context=context)
    node, executor = Node("reader", context=context), SingleThreadedExecutor(context=context)
    executor.add_node(node)
    came: list[Any] = []
    node.create_subscription(JointState, "joint_states", came.append, 10)
    for _ in range(600):
        if came:
            break
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()
    assert came, "no joint_states"
    return dict(zip(came[-1].name, came[-1].position, strict=True))


def test_ctrl_c_brings_the_eyes_back_and_writes_nothing(
    processes: ProcessGroup, tmp_path: Path, domain_id: int
) -> None:
    start_head(processes)
    out = tmp_path / "rig.yaml"
    process = identify(out, "--amplitude-deg", "8", "--axes", "pan_left")
    assert process.stdout is not None
    lines = iter(process.stdout.readline, "")
    assert any(line.startswith("pan_left:") for line in lines)
    while max(abs(angle) for angle in reported(domain_id).values()) < math.radians(3):
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "nothing was written" in errors
    assert "Traceback" not in errors
    assert not out.exists()
    for name, angle in reported(domain_id).items():
        assert abs(angle) < math.radians(1.5), name
