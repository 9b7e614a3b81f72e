"""The whole graph on the simulated head: sim_node, the metric nodes, gaze_controller_node.

ros2 launch vergence_bringup sim.launch.py [preset:=ideal] [detector:=false] [encoder:=false] [namespace:=head]
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, PushRosNamespace

from vergence_bringup.node_table import NODES


def generate_launch_description() -> LaunchDescription:
    config = Path(get_package_share_directory("vergence_bringup")) / "config"
    rig = LaunchConfiguration("rig")

    def node(executable: str, condition: str | None = None, **parameters: object) -> Node:
        return Node(
            package=NODES[executable].package,
            executable=executable,
            output="screen",
            parameters=[str(config / f"{executable}.yaml"), {"rig": rig, **parameters}],
            condition=IfCondition(LaunchConfiguration(condition)) if condition else None,
        )

    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the whole head"),
            DeclareLaunchArgument("rig", default_value=str(config / "rig.yaml"), description="the rig's description"),
            DeclareLaunchArgument(
                "preset", default_value="realistic", description="realistic or ideal cameras and servos"
            ),
            DeclareLaunchArgument(
                "detector", default_value="true", description="run box_metric_node, which knows the simulator's cube"
            ),
            DeclareLaunchArgument(
                "encoder", default_value="true", description="run eye_rotation_node, the visual encoder"
            ),
            DeclareLaunchArgument("fastdds_profile", default_value=str(config / "fastdds.xml")),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", LaunchConfiguration("fastdds_profile")),
            GroupAction(
                [
                    PushRosNamespace(LaunchConfiguration("namespace")),
                    node("sim_node", preset=LaunchConfiguration("preset")),
                    node("edge_metric_node"),
                    node("box_metric_node", "detector"),
                    node("eye_rotation_node", "encoder"),
                    node("gaze_controller_node"),
                ]
            ),
        ]
    )
