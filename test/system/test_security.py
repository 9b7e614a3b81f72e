"""A stranger without keys cannot command the joints of a head whose graph is secured.

Needs a Fast DDS that is built with security, and the `ros2 security` command: both come with ROS from apt.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from ament_index_python.packages import PackageNotFoundError, get_package_prefix

pytestmark = pytest.mark.system

ROOT = Path(__file__).resolve().parents[2]
POLICY = ROOT / "config" / "security" / "vergence.policy.xml"
COMMANDED_S = 8.0
_PLUGIN = b"DDS:Auth:PKI-DH"


def _middleware_has_security() -> bool:
    """Return whether the installed Fast DDS knows the security plugins: a build without them names none."""
    try:
        folder = Path(get_package_prefix("fastrtps")) / "lib"
    except PackageNotFoundError:
        folder = Path(sys.prefix) / "lib"
    return any(_PLUGIN in library.read_bytes() for library in folder.glob("libfast*.so*") if library.is_file())


@pytest.fixture
def keystore(tmp_path: Path) -> Path:
    if not _middleware_has_security():
        pytest.skip("the Fast DDS of this platform is built without security (the wheels' is)")
    if shutil.which("ros2") is None:
        pytest.skip("the command ros2 security is not installed (apt install ros-jazzy-sros2)")
    store = tmp_path / "keys"
    for command in (["create_keystore", str(store)], ["generate_artifacts", "-k", str(store), "-p", str(POLICY)]):
        subprocess.run(["ros2", "security", *command], check=True, capture_output=True, timeout=120)
    return store


def _secured(keystore: Path) -> dict[str, str]:
    return os.environ | {
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_SECURITY_KEYSTORE": str(keystore),
    }


@pytest.mark.parametrize("has_keys", [False, True])
def test_who_may_command_the_joints(has_keys: bool, keystore: Path, tmp_path: Path, domain_id: int) -> None:
    pose = tmp_path / "pose.json"
    argv = [sys.executable, "-m", "vergence_servo.ros.servo_node", "--ros-args", "--enclave", "/vergence/servo_node"]
    argv += ["-p", "backend:=fake", "-p", f"pose_file:={pose}", "-p", "park_time_limit_s:=0.0"]
    node = subprocess.Popen(argv, env=_secured(keystore))
    environment = _secured(keystore) | {"ROS_SECURITY_ENCLAVE_OVERRIDE": "/vergence/operator"} if has_keys else None
    commander = subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("joint_commander.py")), "steady", "0.5"], env=environment
    )
    time.sleep(COMMANDED_S)  # nothing tells of what does not happen
    commander.kill()
    commander.wait()
    node.send_signal(signal.SIGINT)
    assert node.wait(60.0) == 0
    reached = json.loads(pose.read_text())["pan_left"] if pose.exists() else 0.0
    assert (abs(reached) > 0.1) == has_keys
