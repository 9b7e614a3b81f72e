"""A real head on one machine: two cameras, the metrics, the controller and the servos.

ros2 launch vergence_bringup rig.launch.py left_device:=/dev/v4l/by-id/... right_device:=/dev/v4l/by-id/...
With the servos on another machine use laptop.launch.py there and pi.launch.py here, or servos:=false. detector:=true
model:=/path/to/your.onnx adds metric II. composed:=true runs all nodes in one process.
"""

from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, SetEnvironmentVariable
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node, PushRosNamespace
from launch_ros.parameter_descriptions import ParameterValue

from vergence_bringup.node_table import HOSTS, NODES


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

    def own(name: str, executable: str, **values: Any) -> list[Any]:
        """Return the arguments of head_node that give one of its nodes the settings it has as a process of its own."""
        arguments: list[Any] = []
        for file in settings(executable):
            arguments += ["--params", [f"{name}=", file]]
        for parameter, value in values.items():
            # Quoted: otherwise 0 would be a number and off false.
            arguments += ["--set", [f"{name}:{parameter}:='", *(value if isinstance(value, list) else [value]), "'"]]
        return arguments

    def composed_camera(eye: str, lock: str, partner: Any = "") -> list[Any]:
        locked = PythonExpression([f"'{lock}' if '", LaunchConfiguration("lock"), "' == 'true' else 'off'"])
        return own(
            f"{eye}_camera",
            "camera_node",
            rig=rig,
            device=LaunchConfiguration(f"{eye}_device"),
            camera_info_url=LaunchConfiguration(f"{eye}_camera_info_url"),
            frame_id=f"{eye}_camera_optical_frame",
            lock=locked,
            partner=partner,
        )

    composed = LaunchConfiguration("composed")
    chosen = [
        "'left_camera,right_camera,edge_metric_node,gaze_controller_node'",
        *(
            part
            for executable, condition in (
                ("box_metric_node", "detector"),
                ("eye_rotation_node", "encoder"),
                ("servo_node", "servos"),
            )
            for part in (f" + (',{executable}' if '", LaunchConfiguration(condition), "' == 'true' else '')")
        ),
    ]
    head = Node(
        package=HOSTS["head_node"],
        executable="head_node",
        output="screen",
        arguments=[
            "--nodes",
            PythonExpression(chosen),
            *composed_camera("left", "hold"),
            *composed_camera("right", "follow", left_camera),
            *own("edge_metric_node", "edge_metric_node", rig=rig),
            *own("box_metric_node", "box_metric_node", rig=rig, **{"detector.model": LaunchConfiguration("model")}),
            *own("eye_rotation_node", "eye_rotation_node", rig=rig),
            *own("gaze_controller_node", "gaze_controller_node", rig=rig),
            *own("servo_node", "servo_node", rig=rig),
        ],
        condition=IfCondition(composed),
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
            DeclareLaunchArgument(
                "composed",
                default_value="false",
                description="run all nodes in one process, head_node: images pass in memory, which saves CPU time",
            ),
            GroupAction([PushRosNamespace(LaunchConfiguration("namespace")), head]),
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
                ],
                condition=UnlessCondition(composed),
            ),
        ]
    )
