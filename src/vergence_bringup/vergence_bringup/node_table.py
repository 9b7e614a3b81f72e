"""The table of nodes: packages, parameter groups and graphs, for executables, doctor, demo, bench and launch files."""

import importlib
from dataclasses import dataclass

from vergence_rig.parameters import Groups

REAL, SIMULATED, PHOTOGRAPHED = "real", "simulated", "photographed"


@dataclass(frozen=True)
class NodeEntry:
    """One node.

    Attributes:
        package: the ROS package that holds its executable.
        groups: its parameter groups, as "module:NAME" of a `Groups`.
        heads: the kinds of head whose graph it belongs to: REAL, SIMULATED, PHOTOGRAPHED (before photographs); none for
            one that is started on request only.
    """

    package: str
    groups: str
    heads: tuple[str, ...] = (REAL, SIMULATED, PHOTOGRAPHED)


NODES: dict[str, NodeEntry] = {
    "box_metric_node": NodeEntry("vergence_metric", "vergence_metric.boxes.parameters:GROUPS"),
    "camera_node": NodeEntry("vergence_camera", "vergence_camera.parameters:GROUPS", heads=(REAL,)),
    "edge_metric_node": NodeEntry("vergence_metric", "vergence_metric.measurement.parameters:GROUPS"),
    "eye_rotation_node": NodeEntry("vergence_metric", "vergence_metric.eye_rotation.parameters:GROUPS"),
    "gaze_controller_node": NodeEntry("vergence_gaze", "vergence_gaze.parameter_groups:GROUPS"),
    "photo_node": NodeEntry("vergence_sim", "vergence_sim.photo.parameters:GROUPS", heads=(PHOTOGRAPHED,)),
    "servo_node": NodeEntry("vergence_servo", "vergence_servo.parameters:GROUPS", heads=(REAL,)),
    "sim_node": NodeEntry("vergence_sim", "vergence_sim.parameters:NODE_GROUPS", heads=(SIMULATED,)),
    "web_node": NodeEntry("vergence_web", "vergence_web.parameters:GROUPS", heads=()),
}


HOSTS: dict[str, str] = {"head_node": "vergence_bringup", "stereo_node": "vergence_metric"}
"""Executables that run several of these nodes in one process, and the package of each; they have no parameters."""


def package_of(executable: str) -> str:
    """Return the package of a node or of a host of nodes."""
    return HOSTS[executable] if executable in HOSTS else NODES[executable].package


def graph(head: str) -> tuple[str, ...]:
    """Return the executables of the whole graph of a REAL, a SIMULATED or a PHOTOGRAPHED head."""
    return tuple(executable for executable, entry in NODES.items() if head in entry.heads)


def parameter_groups(executable: str) -> Groups:
    """Return (prefix, class) of every parameter group of an executable."""
    module, name = NODES[executable].groups.split(":")
    groups: Groups = getattr(importlib.import_module(module), name)
    return groups
