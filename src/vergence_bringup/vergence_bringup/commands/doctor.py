"""`vergence doctor`: checks what this machine lacks, and how to install it."""

import argparse
import ctypes.util
import grp
import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from vergence_bringup.commands.doctor_trials import folders, middleware, rig_files, shared_memory
from vergence_bringup.graph_errors import ProcessError
from vergence_bringup.machine import APT_ROS, build_hint, is_ros_workspace, package_hint, profile_hint
from vergence_bringup.node_table import HOSTS, NODES
from vergence_bringup.ros.processes import config_dir, find_node
from vergence_rig.finding import Finding
from vergence_rig.install_hint import install_hint

_PACKAGES = {
    "aiohttp": ("python3-aiohttp", "aiohttp"),
    "numpy": ("python3-numpy", "numpy"),
    "cv2": ("python3-opencv", "opencv-python-headless"),
    "yaml": ("python3-yaml", "PyYAML"),
}
"""Names of the packages that every head needs, in apt and on the package index, by module."""
_SHM_NEEDED_MB = 64  # two cameras, three readers and slack, in segments of 16 MiB


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of the subcommand."""
    parser.add_argument("--no-render", action="store_true", help="skip the rendering test (it takes two seconds)")
    parser.add_argument("--rig", default="", metavar="FILE", help="rig.yaml to open (default: the built-in rig)")
    parser.add_argument("--servos", default="", metavar="FILE", help="servos.yaml whose drivers are opened")
    parser.add_argument("--backend", default="kernel_pwm", help="driver of servos for which the file names none")
    parser.add_argument("--model", default="", metavar="FILE", help="ONNX file of the detector to load")


def run(options: argparse.Namespace) -> int:
    """Print every finding; 0 if all required checks passed."""
    files = (options.rig, options.servos, options.backend, options.model)
    findings = list(examine(render=not options.no_render, files=files))
    for finding in findings:
        mark = "ok  " if finding.ok else ("FAIL" if finding.needed else "note")
        print(f"{mark}  {finding.name}: {finding.message}")
        if not finding.ok and finding.remedy:
            print(f"      -> {finding.remedy}")
    missing = sum(not finding.ok and finding.needed for finding in findings)
    print(f"\n{missing} required check{'s' * (missing != 1)} failed" if missing else "\nall required checks passed")
    return 1 if missing else 0


def examine(render: bool = True, files: tuple[str, str, str, str] = ("", "", "", "")) -> Iterable[Finding]:
    """Yield a finding for everything that nodes, demo and build depend on; `files` are those of `rig_files`."""
    yield from _guarded("python", _python)
    yield from _guarded("compiler", _compiler)
    yield from _guarded("ros", _ros)
    yield from _guarded("nodes", _nodes)
    yield from _guarded("middleware", _middleware)
    yield from _guarded("shared memory", _shared_memory)
    yield from _guarded("shared memory segment", shared_memory)
    yield from _guarded("folders", folders)
    yield from _guarded("ROS context", middleware)
    yield from _guarded("rig", lambda: rig_files(*files))
    yield from _guarded("rendering", lambda: _rendering(render))
    yield from _guarded("groups", _groups)
    yield from _guarded("cameras", _cameras)


def _guarded(name: str, check: Callable[[], Iterable[Finding]]) -> Iterable[Finding]:
    try:
        yield from check()
    except Exception as error:  # a check must never raise
        yield Finding(name, False, f"the check failed: {type(error).__name__}: {error}", needed=False)


def _python() -> Iterable[Finding]:
    version = ".".join(map(str, sys.version_info[:3]))
    good = (3, 10) <= sys.version_info[:2] <= (3, 14)
    yield Finding("python", good, f"{version} at {sys.executable}", "use Python 3.10 to 3.14: make setup PYTHON=...")
    for module, (apt, pip) in _PACKAGES.items():
        found = importlib.util.find_spec(module) is not None
        yield Finding(f"python package {module}", found, "installed" if found else "missing", package_hint(apt, pip))
    for name, module, user in (
        ("detector", "onnxruntime", "box_metric_node needs"),
        ("recordings", "rosbags", "vergence record and replay need"),
    ):
        found = importlib.util.find_spec(module) is not None
        message = f"{module} is installed" if found else f"{module} is not installed"
        yield Finding(name, found, message, f"{install_hint(module)}; only {user} it", needed=False)


def _compiler() -> Iterable[Finding]:
    absent = [tool for tool in ("gcc", "g++", "make") if shutil.which(tool) is None]
    message = "gcc, g++ and make are installed" if not absent else "missing: " + ", ".join(absent)
    yield Finding("compiler", not absent, message, "apt install build-essential (the messages are compiled)")
    header = Path(sysconfig.get_paths()["include"]) / "Python.h"
    yield Finding("python headers", header.exists(), str(header), "apt install python3-dev")


def _ros() -> Iterable[Finding]:
    where = f"apt, {APT_ROS}" if APT_ROS.exists() else "wheels in this environment"
    found = importlib.util.find_spec("rclpy") is not None
    yield Finding("rclpy", found, where if found else "cannot be imported", build_hint())
    distro = os.environ.get("ROS_DISTRO", "jazzy")
    yield Finding("ROS distribution", distro == "jazzy", distro, "use ROS 2 Jazzy: this workspace is built for it")


def _nodes() -> Iterable[Finding]:
    absent = []
    for executable in (*NODES, *HOSTS):
        try:
            find_node(executable)
        except ProcessError as error:
            absent.append(str(error))
    count = len(NODES) + len(HOSTS)
    message = f"{count - len(absent)} of {count} are built" + "".join(f"; {text}" for text in absent)
    # A Pi has only what the servos need.
    needed = len(absent) == count or not is_ros_workspace()
    yield Finding("nodes", not absent, message, build_hint(), needed)


def _middleware() -> Iterable[Finding]:
    profile = os.environ.get("FASTRTPS_DEFAULT_PROFILES_FILE")
    remedy = profile_hint(config_dir() / "fastdds.xml")
    if (os.environ.get("RMW_IMPLEMENTATION") or "rmw_fastrtps_cpp") != "rmw_fastrtps_cpp":
        name = os.environ["RMW_IMPLEMENTATION"]
        yield Finding("DDS", True, f"{name} is used: the shipped Fast DDS profile has no effect", needed=False)
    elif profile is None:
        message = "FASTRTPS_DEFAULT_PROFILES_FILE is not set: most raw image pairs will be lost or late"
        yield Finding("DDS profile", False, message, remedy, needed=not is_ros_workspace())
    elif not Path(profile).is_file():
        yield Finding("DDS profile", False, f"no such file: {profile}", remedy)
    else:
        yield Finding("DDS profile", True, profile)
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET (ROS's own default)")
    domain = os.environ.get("ROS_DOMAIN_ID", "0")
    yield Finding("DDS discovery", True, f"range {reach}, domain {domain}", needed=False)


def _shared_memory() -> Iterable[Finding]:
    usage = shutil.disk_usage("/dev/shm")
    free_mb = usage.free / 2**20
    message = f"/dev/shm has {free_mb:.0f} of {usage.total / 2**20:.0f} MiB free, {_SHM_NEEDED_MB} are needed"
    remedy = "mount -o remount,size=512M /dev/shm (in a container: --shm-size=512m)"
    yield Finding("shared memory", free_mb >= _SHM_NEEDED_MB, message, remedy)


def _rendering(test: bool) -> Iterable[Finding]:
    if importlib.util.find_spec("mujoco") is None:
        remedy = f"{install_hint('mujoco')}; only sim_node needs it"
        yield Finding("simulator", False, "mujoco is not installed", remedy, needed=not is_ros_workspace())
        return
    library = ctypes.util.find_library("EGL")
    remedy = "apt install libegl1 libgl1-mesa-dri (only sim_node needs it)"
    needed = not is_ros_workspace()
    yield Finding("libEGL", library is not None, library or "not found", remedy, needed)
    if not test or library is None:
        return
    code = "import mujoco; c = mujoco.GLContext(8, 8); c.make_current(); print(mujoco.__version__)"
    env = os.environ | {"MUJOCO_GL": os.environ.get("MUJOCO_GL", "egl")}
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env, timeout=60)
    lines = (result.stdout if result.returncode == 0 else result.stderr).strip().splitlines() or ["no output"]
    message = f"MuJoCo {lines[-1]} renders with MUJOCO_GL={env['MUJOCO_GL']}" if not result.returncode else lines[-1]
    yield Finding("rendering", result.returncode == 0, message, remedy, needed)


def _groups() -> Iterable[Finding]:
    mine = {grp.getgrgid(number).gr_name for number in os.getgroups() if _has_name(number)}
    purposes = {"video": "cameras", "gpio": "servos on GPIO", "i2c": "servos on a PCA9685"}
    for group, purpose in purposes.items():
        if group not in {entry.gr_name for entry in grp.getgrall()}:
            continue
        member = os.geteuid() == 0 or group in mine
        message = f"access to {purpose}: this user is {'' if member else 'not '}in the group"
        yield Finding(
            f"group {group}", member, message, f"sudo usermod -aG {group} $USER, then log in again", needed=False
        )


def _has_name(group_id: int) -> bool:
    try:
        grp.getgrgid(group_id)
    except KeyError:
        return False
    return True


def _cameras() -> Iterable[Finding]:
    doctor: Any = importlib.import_module("vergence_camera.doctor")
    for finding in doctor.check():
        yield replace(finding, needed=False)  # recordings and the simulator need none
