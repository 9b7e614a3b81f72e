"""Every node executable and the parameter classes it declares: what the shipped YAML and the reference are held to."""

import importlib
from dataclasses import dataclass

from vergence_rig.parameters import Parameters


@dataclass(frozen=True)
class Executable:
    """One node: its package, and each parameter group as (prefix, "module:Class")."""

    package: str
    groups: tuple[tuple[str, str], ...]


EXECUTABLES: dict[str, Executable] = {
    "box_metric_node": Executable(
        "vergence_metric", (("", "vergence_metric.boxes.parameters:BoxMetricNodeParameters"),)
    ),
    "camera_node": Executable("vergence_camera", (("", "vergence_camera.parameters:CameraParameters"),)),
    "edge_metric_node": Executable(
        "vergence_metric", (("", "vergence_metric.measurement.parameters:EdgeMetricNodeParameters"),)
    ),
    "eye_rotation_node": Executable(
        "vergence_metric", (("", "vergence_metric.eye_rotation.parameters:EyeRotationNodeParameters"),)
    ),
    "gaze_controller_node": Executable(
        "vergence_gaze", (("", "vergence_gaze.ros.gaze_controller_node:GazeNodeParameters"),)
    ),
    "servo_node": Executable(
        "vergence_servo",
        (
            ("", "vergence_servo.servo_parameters:ServoNodeParameters"),
            ("fake.", "vergence_servo.drivers.fake:FakeParameters"),
            ("kernel_pwm.", "vergence_servo.drivers.kernel_pwm:KernelPwmParameters"),
            ("pca9685.", "vergence_servo.drivers.pca9685:Pca9685Parameters"),
            ("pigpio.", "vergence_servo.drivers.pigpio:PigpioParameters"),
            ("lgpio.", "vergence_servo.drivers.lgpio:LgpioParameters"),
        ),
    ),
    "sim_node": Executable("vergence_sim", (("", "vergence_sim.parameters:SimParameters"),)),
}


def parameter_groups(executable: str) -> list[tuple[str, type[Parameters]]]:
    """Return (prefix, class) of every parameter group of an executable."""
    groups = []
    for prefix, place in EXECUTABLES[executable].groups:
        module, name = place.split(":")
        groups.append((prefix, getattr(importlib.import_module(module), name)))
    return groups
