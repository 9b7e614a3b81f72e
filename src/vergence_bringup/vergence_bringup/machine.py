"""What kind of machine this is: ROS from apt in a colcon workspace, or the wheels and `env.sh`."""

import os
from pathlib import Path

APT_ROS = Path("/opt/ros/jazzy")


def is_ros_workspace() -> bool:
    """Return True where ROS comes from apt and this shell has not sourced `env.sh`."""
    return APT_ROS.is_dir() and "VERGENCE_CONFIG_DIR" not in os.environ


def build_hint() -> str:
    """Return how to build the workspace and to make a shell that has it."""
    if is_ros_workspace():
        return "in the workspace: colcon build --symlink-install, then source install/setup.bash"
    return "make setup, then source env.sh"


def shell_hint() -> str:
    """Return the command that makes a shell in which the executables are found."""
    return "source install/setup.bash" if is_ros_workspace() else "source env.sh"


def package_hint(apt: str, pip: str) -> str:
    """Return how to install a Python package that every node needs, by its names in apt and on the package index."""
    return f"sudo apt install {apt}" if is_ros_workspace() else f"make setup (it installs {pip})"


def profile_hint(profile: Path) -> str:
    """Return how to give a shell the shipped Fast DDS profile."""
    export = f"export FASTRTPS_DEFAULT_PROFILES_FILE={profile}"
    if is_ros_workspace():
        return f"{export} (the launch files set it for their nodes)"
    return f"source env.sh, or {export}"
