"""The Pi's side of a head on two machines: servo_node alone.

ros2 launch vergence_bringup pi.launch.py servos:=/home/me/servos.yaml [backend:=pca9685]
The other side is laptop.launch.py; docs/two_machines.md says what both need. servo_node is restarted when it
crashes; a clean end, or an invalid configuration, ends the launch.
"""

from collections.abc import Mapping
from typing import Any

from launch import LaunchDescription
from launch.actions import LogInfo, SetEnvironmentVariable

from vergence_bringup.launching.servo_choice import chosen_backend, fakes_banner, problems
from vergence_bringup.ros.launch_actions import described, head, node


def build(values: Mapping[str, str]) -> list[Any]:
    own = {"rig": values["rig"], "servos": values["servos"], "start": values["start"]}
    own["backend"] = chosen_backend(values)
    fakes = fakes_banner(values)
    # After a crash the next start releases servos that were left driven.
    servo_node = node("servo_node", values["params_file"], respawn=True, parameters=own)
    return [
        *([LogInfo(msg=fakes)] if fakes else []),
        SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", values["discovery_range"]),
        *head(values, servo_node),
    ]


def generate_launch_description() -> LaunchDescription:
    return described("pi.launch.py", build, problems)
