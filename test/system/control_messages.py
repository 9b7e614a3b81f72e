"""control_msgs for tests, where it is not installed: the interfaces that the nodes use, built once by colcon.

The definitions have the fields and constants of ros-controls' package, which is what goes over the wire.
"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_FOLDER = ROOT / "build" / "control_msgs_for_tests"

_TOLERANCE = "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n"
_COMPONENT_TOLERANCE = (
    "uint16 X_AXIS=1\nuint16 Y_AXIS=2\nuint16 Z_AXIS=3\nuint16 TRANSLATION=4\nuint16 ROTATION=5\n"
    "string joint_name\nuint16 component\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n"
)
_POINT_HEAD = (
    "geometry_msgs/PointStamped target\ngeometry_msgs/Vector3 pointing_axis\nstring pointing_frame\n"
    "builtin_interfaces/Duration min_duration\nfloat64 max_velocity\n---\n---\nfloat64 pointing_angle_error\n"
)
_FOLLOW = (
    "trajectory_msgs/JointTrajectory trajectory\ntrajectory_msgs/MultiDOFJointTrajectory multi_dof_trajectory\n"
    "JointTolerance[] path_tolerance\nJointComponentTolerance[] component_path_tolerance\n"
    "JointTolerance[] goal_tolerance\nJointComponentTolerance[] component_goal_tolerance\n"
    "builtin_interfaces/Duration goal_time_tolerance\n---\n"
    "int32 error_code\nint32 SUCCESSFUL=0\nint32 INVALID_GOAL=-1\nint32 INVALID_JOINTS=-2\n"
    "int32 OLD_HEADER_TIMESTAMP=-3\nint32 PATH_TOLERANCE_VIOLATED=-4\nint32 GOAL_TOLERANCE_VIOLATED=-5\n"
    "string error_string\n---\n"
    "std_msgs/Header header\nstring[] joint_names\n"
    "trajectory_msgs/JointTrajectoryPoint desired\ntrajectory_msgs/JointTrajectoryPoint actual\n"
    "trajectory_msgs/JointTrajectoryPoint error\n"
    "string[] multi_dof_joint_names\ntrajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_desired\n"
    "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_actual\n"
    "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error\n"
)
_NEEDED = ("action_msgs", "builtin_interfaces", "geometry_msgs", "std_msgs", "trajectory_msgs")
_FILES = {
    "msg/JointTolerance.msg": _TOLERANCE,
    "msg/JointComponentTolerance.msg": _COMPONENT_TOLERANCE,
    "action/PointHead.action": _POINT_HEAD,
    "action/FollowJointTrajectory.action": _FOLLOW,
    "CMakeLists.txt": "\n".join(
        [
            "cmake_minimum_required(VERSION 3.8)",
            "project(control_msgs)",
            "find_package(ament_cmake REQUIRED)",
            "find_package(rosidl_default_generators REQUIRED)",
            *(f"find_package({name} REQUIRED)" for name in _NEEDED),
            "rosidl_generate_interfaces(${PROJECT_NAME} msg/JointTolerance.msg msg/JointComponentTolerance.msg",
            "  action/PointHead.action action/FollowJointTrajectory.action",
            f"  DEPENDENCIES {' '.join(_NEEDED)})",
            "ament_package()",
            "",
        ]
    ),
    "package.xml": "\n".join(
        [
            '<package format="3"><name>control_msgs</name><version>0.0.0</version><description>For tests</description>',
            '<maintainer email="vergence-maintainers@example.org">Vergence maintainers</maintainer>',
            "<license>Apache-2.0</license><buildtool_depend>ament_cmake</buildtool_depend>",
            "<buildtool_depend>rosidl_default_generators</buildtool_depend>",
            *(f"<depend>{name}</depend>" for name in _NEEDED),
            "<exec_depend>rosidl_default_runtime</exec_depend>",
            "<member_of_group>rosidl_interface_packages</member_of_group>",
            "<export><build_type>ament_cmake</build_type></export></package>",
            "",
        ]
    ),
}


def environment_with_control_msgs() -> dict[str, str]:
    """Return this environment with control_msgs in it, built first if it has not been yet."""
    prefix = _FOLDER / "install" / "control_msgs"
    stamp, wanted = _FOLDER / "stamp", hashlib.sha256(repr((_FILES, sys.version)).encode()).hexdigest()
    if not stamp.is_file() or stamp.read_text() != wanted:
        _build()
        stamp.write_text(wanted)
    changed = dict(os.environ)
    (site,) = prefix.glob("lib/python*/site-packages")
    for name, value in (
        ("PYTHONPATH", site),
        ("LD_LIBRARY_PATH", prefix / "lib"),
        ("AMENT_PREFIX_PATH", prefix),
    ):
        changed[name] = os.pathsep.join([str(value), *filter(None, [changed.get(name)])])
    return changed


def _build() -> None:
    for name, text in _FILES.items():
        path = _FOLDER / "src" / "control_msgs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    prefixes = os.pathsep.join(filter(None, [os.environ.get("AMENT_PREFIX_PATH"), os.environ.get("CMAKE_PREFIX_PATH")]))
    python = f"-DPython3_EXECUTABLE={sys.executable}"
    command = [sys.executable, "-m", "colcon", "--log-base", "log", "build", "--base-paths", "src"]
    command += ["--cmake-args", "-DBUILD_TESTING=OFF", python, f"-DPYTHON_EXECUTABLE={sys.executable}"]
    environment = dict(os.environ, CMAKE_PREFIX_PATH=prefixes)
    done = subprocess.run(command, cwd=_FOLDER, env=environment, capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, f"control_msgs cannot be built:\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"
