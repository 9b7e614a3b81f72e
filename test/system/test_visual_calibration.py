"""The visual calibration on the simulated head, whose servos are mounted otherwise than the file says."""

import math
from collections.abc import Mapping

import pytest

from vergence_calibration.eye_turn import Image
from vergence_calibration.servos.visual import VisualParameters, calibrate_head
from vergence_rig.camera import CameraModel
from vergence_rig.rig import default_rig
from vergence_servo.calibration import default_servos

pytestmark = [pytest.mark.system, pytest.mark.timeout(180)]

simulator = pytest.importorskip("vergence_sim.simulator", reason="the simulator cannot be imported here")

DEG = math.pi / 180
TRUE_SIGN = {"pan_left": 1, "pan_right": -1, "tilt": -1}
TRUE_GAIN = {"pan_left": 0.1 * DEG, "pan_right": 0.085 * DEG, "tilt": 0.095 * DEG}


class SimulatedHead:
    """The simulator behind servos that are unknown to the calibration: pulse to angle by their own sign and gain."""

    def __init__(self) -> None:
        self.servos = default_servos()
        self.simulator = simulator.Simulator(simulator.SimParameters.of({"head.model": "rolled"}))

    def look(self, joints_rad: Mapping[str, float]) -> dict[str, Image]:
        pulses_us = {name: self.servos[name].pulse_us(angle) for name, angle in joints_rad.items()}
        self.simulator.command({n: TRUE_SIGN[n] * TRUE_GAIN[n] * (pulses_us[n] - 1500.0) for n in pulses_us})
        self.simulator.advance(0.6)
        return {eye: self.simulator.view(eye) for eye in ("left", "right")}


def test_signs_gains_and_lost_motion_of_the_simulated_head_are_found():
    head = SimulatedHead()
    rig = default_rig()
    cameras = {"left": CameraModel(rig.left_camera), "right": CameraModel(rig.right_camera)}
    fresh = calibrate_head(head, head.servos, cameras, rig.baseline_m, VisualParameters(), print)
    for name, servo in fresh.items():
        assert servo.sign == TRUE_SIGN[name]
        found_rad = abs(servo.joint_rad(1600.0) - servo.joint_rad(1500.0))
        print(f"{name}: gain off by {100 * (found_rad / (100 * TRUE_GAIN[name]) - 1):+.2f} %")
        assert found_rad == pytest.approx(100 * TRUE_GAIN[name], rel=0.06)
        lost_rad = rig.joints[name].servo.dead_band_rad + rig.joints[name].servo.backlash_rad
        assert servo.dead_band_rad + servo.backlash_rad == pytest.approx(lost_rad, abs=0.4 * DEG)
