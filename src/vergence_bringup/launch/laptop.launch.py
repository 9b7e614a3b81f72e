"""The laptop's side of a head on two machines: cameras, metrics and controller; servo_node runs on the Pi.

ros2 launch vergence_bringup laptop.launch.py left_device:=/dev/v4l/by-id/... right_device:=/dev/v4l/by-id/...
The other side is pi.launch.py; docs/two_machines.md lists what both need. The arguments are those of rig.launch.py,
without the servos'.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription, SetEnvironmentVariable
from launch.launch_description_sources import PythonLaunchDescriptionSource

from vergence_bringup.ros.launch_actions import described


def build(values: Mapping[str, str]) -> list[Any]:
    # An included launch file gets what it is handed: it does not have the command line's arguments.
    handed = {name: value for name, value in values.items() if name != "discovery_range"}
    handed |= {"servo_node": "false", "servos": "", "backend": ""}
    rig_launch = Path(get_package_share_directory("vergence_bringup")) / "launch" / "rig.launch.py"
    return [
        SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", values["discovery_range"]),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(str(rig_launch)), launch_arguments=handed.items()),
    ]


def generate_launch_description() -> LaunchDescription:
    return described("laptop.launch.py", build)
