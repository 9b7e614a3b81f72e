"""The whole graph on the simulated head: sim_node, the metric nodes, gaze_controller_node.

ros2 launch vergence_bringup sim.launch.py [preset:=ideal] [head:=rig] [detector:=false] [encoder:=false] [attend:=true]
    [namespace:=head] [use_sim_time:=true] [web:=true]
"""

from collections.abc import Mapping
from typing import Any

from launch import LaunchDescription

from vergence_bringup.ros.launch_actions import described, frames, head, node


def build(values: Mapping[str, str]) -> list[Any]:
    shared = {"rig": values["rig"], "use_sim_time": values["use_sim_time"] == "true"}
    executables = ["sim_node", "edge_metric_node", "gaze_controller_node"]
    executables += ["box_metric_node"] * (values["detector"] == "true")
    executables += ["eye_rotation_node"] * (values["encoder"] == "true")
    executables += ["web_node"] * (values["web"] == "true")
    own = {
        "sim_node": {"preset": values["preset"], "head.model": values["head"]},
        "web_node": {"address": values["web_address"]},
    }
    if values["attend"] == "true":
        own["gaze_controller_node"] = {"start": "attend"}
    nodes = [node(name, parameters=shared | own.get(name, {})) for name in executables]
    return head(values, *nodes, *frames(values, use_sim_time=shared["use_sim_time"]))


def generate_launch_description() -> LaunchDescription:
    return described("sim.launch.py", build)
