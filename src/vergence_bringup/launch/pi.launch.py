"""The Pi's side of a head on two machines: servo_node alone.

ros2 launch vergence_bringup pi.launch.py backend:=kernel_pwm servos:=/home/me/servos.yaml
The other side is laptop.launch.py; docs/two_machines.md says what both need. servo_node is started again when it
crashed; a clean end, or a configuration that it refuses, ends the launch.
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
    """End the launch, and with it the wait for the respawn, where starting again would be of no use."""
    if context.is_shutdown or event.returncode not in (CLEAN_END, REFUSED):
        return None
    reason = "servo_node ended" if event.returncode == CLEAN_END else "servo_node refuses its configuration"
    return [EmitEvent(event=Shutdown(reason=reason))]


def generate_launch_description() -> LaunchDescription:
    config = Path(get_package_share_directory("vergence_bringup")) / "config"
    names = ("rig", "backend", "servos", "start")
    servo_node = Node(
        package=NODES["servo_node"].package,
        executable="servo_node",
        output="screen",
        # the next start releases whatever a crash left pulsing
        respawn=True,
        respawn_delay=2.0,
        parameters=[LaunchConfiguration("params_file"), {name: LaunchConfiguration(name) for name in names}],
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the whole head"),
            DeclareLaunchArgument("rig", default_value=str(config / "rig.yaml"), description="the rig's description"),
            DeclareLaunchArgument(
                "backend", default_value="kernel_pwm", description="kernel_pwm, pca9685, pigpio, ..."
            ),
            DeclareLaunchArgument("servos", description="your servos.yaml: channels and calibration"),
            DeclareLaunchArgument(
                "params_file", default_value=str(config / "servo_node.yaml"), description="servo_node's own YAML"
            ),
            DeclareLaunchArgument("start", default_value="released", description="released or last_pose"),
            DeclareLaunchArgument("discovery_range", default_value="SUBNET", description="LOCALHOST hides it again"),
            DeclareLaunchArgument("fastdds_profile", default_value=str(config / "fastdds.xml")),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", LaunchConfiguration("fastdds_profile")),
            SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", LaunchConfiguration("discovery_range")),
            RegisterEventHandler(OnProcessExit(target_action=servo_node, on_exit=end_unless_crashed)),
            GroupAction([PushRosNamespace(LaunchConfiguration("namespace")), servo_node]),
        ]
    )
