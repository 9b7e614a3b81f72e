"""The Pi's side of a head on two machines: servo_node alone.

ros2 launch vergence_bringup pi.launch.py backend:=kernel_pwm servos:=/home/me/servos.yaml
The other side is laptop.launch.py; docs/two_machines.md says what both need.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace


def generate_launch_description() -> LaunchDescription:
    config = Path(get_package_share_directory("vergence_bringup")) / "config"
    names = ("rig", "backend", "servos", "start")
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the whole head"),
            DeclareLaunchArgument("rig", default_value=str(config / "rig.yaml"), description="the rig's description"),
            DeclareLaunchArgument(
                "backend", default_value="kernel_pwm", description="kernel_pwm, pca9685, pigpio, ..."
            ),
            DeclareLaunchArgument("servos", description="your servos.yaml: channels and calibration"),
            DeclareLaunchArgument("start", default_value="released", description="released or last_pose"),
            DeclareLaunchArgument("discovery_range", default_value="SUBNET", description="LOCALHOST hides it again"),
            DeclareLaunchArgument("fastdds_profile", default_value=str(config / "fastdds.xml")),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", LaunchConfiguration("fastdds_profile")),
            SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", LaunchConfiguration("discovery_range")),
            GroupAction(
                [
                    PushRosNamespace(LaunchConfiguration("namespace")),
                    Node(
                        package="vergence_servo",
                        executable="servo_node",
                        output="screen",
                        # after a crash the next start releases what was left pulsing
                        respawn=True,
                        respawn_delay=2.0,
                        parameters=[
                            str(config / "servo_node.yaml"),
                            {name: LaunchConfiguration(name) for name in names},
                        ],
                    ),
                ]
            ),
        ]
    )
