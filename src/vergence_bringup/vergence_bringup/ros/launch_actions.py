"""The table of launch arguments as launch actions, the check before anything starts, and nodes whose end is reported.

Needs `launch`, which comes with ROS from apt: only the launch files import this module.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_prefix, get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    GroupAction,
    LogInfo,
    OpaqueFunction,
    SetEnvironmentVariable,
)
from launch.events import Shutdown
from launch.events.process import ProcessExited
from launch_ros.actions import Node, PushRosNamespace, SetRemap
from launch_ros.parameter_descriptions import ParameterValue

from vergence_bringup.launching.arguments import ARGUMENTS, problems, unknown
from vergence_bringup.launching.endings import ending
from vergence_bringup.node_table import HOSTS, NODES
from vergence_rig.head_urdf import head_urdf
from vergence_rig.rig_file import load_rig

Build = Callable[[Mapping[str, str]], list[Any]]
Check = Callable[[Mapping[str, str]], list[str]]

_FRAMES = "robot_state_publisher"
_FRAMES_APT = "sudo apt install ros-jazzy-robot-state-publisher"


class LaunchArgumentError(ValueError):
    """Arguments with which a launch file cannot start: one line for each."""


def config_folder() -> Path:
    """Return the folder of the installed configuration."""
    return Path(get_package_share_directory("vergence_bringup")) / "config"


def described(file: str, build: Build, check: Check = lambda values: []) -> LaunchDescription:
    """Return the description of a launch file of the table.

    Its arguments are declared, then all of them are checked, and only then `build` makes the actions from their values.
    `check` returns further problems of the values.
    """

    def checked(context: LaunchContext) -> list[Any]:
        values = {a.name: a.read(context.launch_configurations[a.name]) for a in ARGUMENTS[file]}
        found = unknown(file, sys.argv) + problems(file, values)
        if values.get("frames") == "true" and not _installed(_FRAMES):
            found.append(f"frames must be auto or false without the package {_FRAMES}: got 'true' ({_FRAMES_APT})")
        found += check(values) if not found else []
        if found:
            raise LaunchArgumentError("\n  ".join([f"{file} starts nothing:", *found]))
        return build(values)

    return LaunchDescription([*declarations(file), OpaqueFunction(function=checked)])


def declarations(file: str) -> list[DeclareLaunchArgument]:
    """Return the declarations of a launch file's arguments."""
    config = config_folder()
    return [
        DeclareLaunchArgument(argument.name, default_value=argument.default_in(config), description=argument.help())
        for argument in ARGUMENTS[file]
    ]


def head(values: Mapping[str, str], *nodes: Node) -> list[Any]:
    """Return the nodes of a head in its namespace, with the Fast DDS profile.

    tf is relative, so that two heads in namespaces have a tree each, with the same names of frames.
    """
    own_tree = [SetRemap("/tf", "tf"), SetRemap("/tf_static", "tf_static")]
    return [
        SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", values["fastdds_profile"]),
        GroupAction([PushRosNamespace(values["namespace"]), *own_tree, *nodes]),
    ]


def frames(values: Mapping[str, str], **parameters: Any) -> list[Node]:
    """Return robot_state_publisher with the head's URDF, where it is wanted: the argument `frames`."""
    if values["frames"] == "false" or (values["frames"] == "auto" and not _installed(_FRAMES)):
        return []
    urdf = head_urdf(load_rig(values["rig"]))
    return [
        Node(
            package=_FRAMES,
            executable=_FRAMES,
            output="screen",
            parameters=[{"robot_description": ParameterValue(urdf, value_type=str), **parameters}],
            on_exit=_report_end(_FRAMES, respawns=False),
        )
    ]


def node(executable: str, *files: Path | str, respawn: bool = False, **options: Any) -> Node:
    """Return a node of the table; its end is reported, and ends the launch where the head cannot work without it.

    Args:
        executable: of the table.
        files: parameter files; the shipped one where there is none.
        respawn: start it again after a crash.
        options: `name` and `namespace` of the node, and its `parameters` by name, after those of the files.
    """
    values = {name: _as_parameter(value) for name, value in options.pop("parameters", {}).items()}

    return Node(
        package=NODES[executable].package,
        executable=executable,
        output="screen",
        parameters=[*map(str, files or (config_folder() / f"{executable}.yaml",)), values],
        respawn=respawn,
        respawn_delay=2.0 if respawn else 0.0,
        on_exit=_report_end(executable, respawn),
        **options,
    )


def host(executable: str, arguments: Sequence[str]) -> Node:
    """Return a host of several nodes of the table; the launch ends with it."""
    return Node(
        package=HOSTS[executable],
        executable=executable,
        output="screen",
        arguments=list(arguments),
        on_exit=_report_end(executable, respawns=False),
    )


def _report_end(executable: str, respawns: bool) -> Callable[[ProcessExited, LaunchContext], list[Any] | None]:
    def on_exit(event: ProcessExited, context: LaunchContext) -> list[Any] | None:
        if context.is_shutdown:
            return None
        end = ending(executable, event.returncode, respawns)
        actions: list[Any] = [LogInfo(msg=end.text)]
        if end.ends_launch:
            actions.append(EmitEvent(event=Shutdown(reason=f"{executable} ended")))
        return actions

    return on_exit


def _installed(package: str) -> bool:
    try:
        get_package_prefix(package)
    except PackageNotFoundError:
        return False
    return True


def _as_parameter(value: object) -> object:
    # Otherwise launch reads 0 as a number and off as false.
    return ParameterValue(value, value_type=str) if isinstance(value, str) else value
