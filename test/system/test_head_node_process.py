"""Several nodes as one process: they start, appear under their own names, and end together on a signal."""

import os
import signal
import subprocess
import time
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from vergence_bringup.node_table import HOSTS
from vergence_bringup.ros.processes import find_node

pytestmark = pytest.mark.system

TIMEOUT_S = 60.0


def test_the_chosen_nodes_run_in_the_given_namespace_and_end_together(domain_id: int, tmp_path: Path) -> None:
    pose = tmp_path / "pose.yaml"
    arguments = ["--nodes", "gaze_controller_node,servo_node", "--set", f"servo_node:pose_file:={pose}"]
    command = [str(find_node("head_node")), *arguments, "--ros-args", "-r", "__ns:=/head"]
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    watcher = Node("watcher", context=context)
    wanted = {("gaze_controller_node", "/head"), ("servo_node", "/head")}
    process = subprocess.Popen(command, env=os.environ | {"ROS_DOMAIN_ID": str(domain_id)})
    try:
        end_s = time.monotonic() + TIMEOUT_S
        while not wanted <= set(watcher.get_node_names_and_namespaces()):
            assert process.poll() is None
            assert time.monotonic() < end_s
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        assert process.wait(TIMEOUT_S) == 0
    finally:
        process.kill()
        watcher.destroy_node()
        context.try_shutdown()


@pytest.mark.parametrize("executable", sorted(HOSTS))
def test_a_node_that_is_not_there_ends_the_process(executable: str, domain_id: int) -> None:
    command = [str(find_node(executable)), "--nodes", "hand_node"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S)
    assert result.returncode == 2
    assert "hand_node" in result.stderr
    assert "Traceback" not in result.stderr
