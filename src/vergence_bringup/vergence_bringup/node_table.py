"""The nodes of the graph: the one table that executables, doctor, demo, benchmarks and launch files read."""

import importlib
from dataclasses import dataclass

from vergence_rig.parameters import Groups


@dataclass(frozen=True)
class NodeEntry:
    """One node: its package, and where its parameter groups stand, as "module:NAME" of a `Groups`."""

    package: str
    groups: str


NODES: dict[str, NodeEntry] = {
    "box_metric_node": NodeEntry("vergence_metric", "vergence_metric.boxes.parameters:GROUPS"),
    "camera_node": NodeEntry("vergence_camera", "vergence_camera.parameters:GROUPS"),
    "edge_metric_node": NodeEntry("vergence_metric", "vergence_metric.measurement.parameters:GROUPS"),
    "eye_rotation_node": NodeEntry("vergence_metric", "vergence_metric.eye_rotation.parameters:GROUPS"),
    "gaze_controller_node": NodeEntry("vergence_gaze", "vergence_gaze.parameters:GROUPS"),
    "servo_node": NodeEntry("vergence_servo", "vergence_servo.servo_parameters:GROUPS"),
    "sim_node": NodeEntry("vergence_sim", "vergence_sim.parameters:GROUPS"),
}


def parameter_groups(executable: str) -> Groups:
    """Return (prefix, class) of every parameter group of an executable."""
    module, name = NODES[executable].groups.split(":")
    groups: Groups = getattr(importlib.import_module(module), name)
    return groups
