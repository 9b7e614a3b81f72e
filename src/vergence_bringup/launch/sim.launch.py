"""The whole graph on the simulated head: sim_node, the metric nodes, gaze_controller_node.

ros2 launch vergence_bringup sim.launch.py [preset:=ideal] [detector:=false] [encoder:=false] [namespace:=head]
    [use_sim_time:=true]
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
    rig, simulated = LaunchConfiguration("rig"), LaunchConfiguration("use_sim_time")

    def node(executable: str, condition: str | None = None, **parameters: object) -> Node:
        return Node(
            package=NODES[executable].package,
            executable=executable,
            output="screen",
            parameters=[str(config / f"{executable}.yaml"), {"rig": rig, "use_sim_time": simulated, **parameters}],
            condition=IfCondition(LaunchConfiguration(condition)) if condition else None,
        )

    return LaunchDescription(
        [
            DeclareLaunchArgument("namespace", default_value="", description="namespace of all nodes of the head"),
            DeclareLaunchArgument("rig", default_value=str(config / "rig.yaml"), description="path of rig.yaml"),
            DeclareLaunchArgument(
                "preset",
                default_value="realistic",
                description="imperfections of cameras and servos: realistic or ideal",
            ),
            DeclareLaunchArgument(
                "detector",
                default_value="true",
                description="run box_metric_node, whose detector finds the simulator's cube",
            ),
            DeclareLaunchArgument(
                "encoder",
                default_value="true",
                description="run eye_rotation_node, the visual encoder of the eyes' angles",
            ),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                description="simulated time: sim_node publishes /clock, which waits for the nodes that follow it",
            ),
            DeclareLaunchArgument(
                "fastdds_profile", default_value=str(config / "fastdds.xml"), description="Fast DDS profile"
            ),
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
