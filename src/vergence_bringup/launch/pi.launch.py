"""The Pi's side of a head on two machines: servo_node alone.

ros2 launch vergence_bringup pi.launch.py backend:=kernel_pwm servos:=/home/me/servos.yaml
The other side is laptop.launch.py; docs/two_machines.md says what both need. servo_node is restarted when it
crashes; a clean end, or an invalid configuration, ends the launch.
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    GroupAction,
    RegisterEventHandler,
    SetEnvironmentVariable,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace

from vergence_bringup.node_table import NODES

CLEAN_END, REFUSED = 0, 2


def end_unless_crashed(event, context):
    """End the launch, and the wait for the respawn, where a restart would not help."""
    if context.is_shutdown or event.returncode not in (CLEAN_END, REFUSED):
        return None
    reason = "servo_node ended" if event.returncode == CLEAN_END else "the configuration of servo_node is invalid"
    return [EmitEvent(event=Shutdown(reason=reason))]


def generate_launch_description() -> LaunchDescription:
    config = Path(get_package_share_directory("vergence_bringup")) / "config"
    names = ("rig", "backend", "servos", "start")
    servo_node = Node(
        package=NODES["servo_node"].package,
        executable="servo_node",
        output="screen",
        # The next start releases servos that a crash left driven.
        respawn=True,
        respawn_delay=2.0,
        parameters=[LaunchConfiguration("params_file"), {name: LaunchConfiguration(name) for name in names}],
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="namespace of all nodes of the head"),
            DeclareLaunchArgument("rig", default_value=str(config / "rig.yaml"), description="path of rig.yaml"),
            DeclareLaunchArgument(
                "backend", default_value="kernel_pwm", description="servo driver: kernel_pwm, pca9685, pigpio, ..."
            ),
            DeclareLaunchArgument("servos", description="path of servos.yaml: channels and calibration"),
            DeclareLaunchArgument(
                "params_file", default_value=str(config / "servo_node.yaml"), description="parameter file of servo_node"
            ),
            DeclareLaunchArgument(
                "start", default_value="released", description="servos at the start: released or last_pose"
            ),
            DeclareLaunchArgument(
                "discovery_range", default_value="SUBNET", description="ROS discovery range: SUBNET, or LOCALHOST"
            ),
            DeclareLaunchArgument(
                "fastdds_profile", default_value=str(config / "fastdds.xml"), description="Fast DDS profile"
            ),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", LaunchConfiguration("fastdds_profile")),
            SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", LaunchConfiguration("discovery_range")),
            RegisterEventHandler(OnProcessExit(target_action=servo_node, on_exit=end_unless_crashed)),
            GroupAction([PushRosNamespace(LaunchConfiguration("namespace")), servo_node]),
        ]
    )
