"""The laptop's side of a head on two machines: cameras, metrics and controller; servo_node runs on the Pi.

ros2 launch vergence_bringup laptop.launch.py left_device:=/dev/v4l/by-id/... right_device:=/dev/v4l/by-id/...
The other side is pi.launch.py; docs/two_machines.md lists what both need. The arguments are those of rig.launch.py.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, SetEnvironmentVariable
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration


def generate_launch_description() -> LaunchDescription:
    rig_launch = Path(get_package_share_directory("vergence_bringup")) / "launch" / "rig.launch.py"
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "discovery_range", default_value="SUBNET", description="ROS discovery range; the Pi must be in it"
            ),
            SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", LaunchConfiguration("discovery_range")),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(rig_launch)), launch_arguments={"servos": "false"}.items()
            ),
        ]
    )
