"""A real head on one machine: two cameras, the metrics, the controller and the servos.

ros2 launch vergence_bringup rig.launch.py left_device:=/dev/v4l/by-id/... right_device:=/dev/v4l/by-id/...
With the servos on another machine use laptop.launch.py there and pi.launch.py here, or servos:=false. detector:=true
model:=/path/to/your.onnx adds metric II.
"""

from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, SetEnvironmentVariable
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node, PushRosNamespace
from launch_ros.parameter_descriptions import ParameterValue

from vergence_bringup.node_table import NODES


def generate_launch_description() -> LaunchDescription:
    config = Path(get_package_share_directory("vergence_bringup")) / "config"
    rig = LaunchConfiguration("rig")

    def text(value: Any) -> ParameterValue:
        # Otherwise launch reads 0 as a number and off as false.
        return ParameterValue(value, value_type=str)

    def settings(executable: str) -> list[Any]:
        # The second file is the result of vergence identify; without one it is the first again.
        shipped = str(config / f"{executable}.yaml")
        return [shipped, PythonExpression(["'", LaunchConfiguration("identified"), f"' or '{shipped}'"])]

    def camera(eye: str, lock: str, partner: Any = "") -> Node:
        # camera_node publishes image_raw and camera_info relative to its namespace: left/... and right/...
        return Node(
            package=NODES["camera_node"].package,
            executable="camera_node",
            name="camera_node",
            namespace=eye,
            output="screen",
            parameters=[
                *settings("camera_node"),
                {
                    "rig": rig,
                    "device": text(LaunchConfiguration(f"{eye}_device")),
                    "camera_info_url": text(LaunchConfiguration(f"{eye}_camera_info_url")),
                    "frame_id": f"{eye}_camera_optical_frame",
                    # One exposure and white balance for both eyes: see docs/cameras.md.
                    "lock": text(
                        PythonExpression([f"'{lock}' if '", LaunchConfiguration("lock"), "' == 'true' else 'off'"])
                    ),
                    "partner": text(partner),
                },
            ],
        )

    left_camera = PythonExpression(["'/' + '", LaunchConfiguration("namespace"), "/left/camera_node'.strip('/')"])

    def node(executable: str, condition: str | None = None, **parameters: object) -> Node:
        return Node(
            package=NODES[executable].package,
            executable=executable,
            output="screen",
            parameters=[*settings(executable), {"rig": rig, **parameters}],
            condition=IfCondition(LaunchConfiguration(condition)) if condition else None,
        )

    return LaunchDescription(
        [
            DeclareLaunchArgument("left_device", description="left camera: by-id path, serial, /dev/videoN or URL"),
            DeclareLaunchArgument("right_device", description="right camera: by-id path, serial, /dev/videoN or URL"),
            DeclareLaunchArgument(
                "left_camera_info_url",
                default_value="",
                description="calibration of the left camera: file:// or package:// YAML",
            ),
            DeclareLaunchArgument(
                "right_camera_info_url",
                default_value="",
                description="calibration of the right camera: file:// or package:// YAML",
            ),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of all nodes of the head"),
            DeclareLaunchArgument("rig", default_value=str(config / "rig.yaml"), description="path of rig.yaml"),
            DeclareLaunchArgument(
                "identified", default_value="", description="path of rig.nodes.yaml, written by vergence identify"
            ),
            DeclareLaunchArgument("servos", default_value="true", description="run servo_node on this machine"),
            DeclareLaunchArgument("detector", default_value="false", description="run box_metric_node"),
            DeclareLaunchArgument(
                "model",
                default_value="",
                description="ONNX file of the detector; empty for the one of the simulator's cube",
            ),
            DeclareLaunchArgument(
                "lock", default_value="true", description="hold one exposure and white balance for both cameras"
            ),
            DeclareLaunchArgument(
                "encoder",
                default_value="true",
                description="run eye_rotation_node, the visual encoder of the eyes' angles",
            ),
            DeclareLaunchArgument(
                "fastdds_profile", default_value=str(config / "fastdds.xml"), description="Fast DDS profile"
            ),
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", LaunchConfiguration("fastdds_profile")),
            GroupAction(
                [
                    PushRosNamespace(LaunchConfiguration("namespace")),
                    camera("left", "hold"),
                    camera("right", "follow", left_camera),
                    node("edge_metric_node"),
                    node("box_metric_node", "detector", **{"detector.model": text(LaunchConfiguration("model"))}),
                    node("eye_rotation_node", "encoder"),
                    node("gaze_controller_node"),
                    node("servo_node", "servos"),
                ]
            ),
        ]
    )
