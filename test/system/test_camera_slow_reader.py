"""A reader that stands still holds up no camera, and gets the newest frames when it goes on, not those it missed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from vergence_bringup.processes import NodeCommand
from vergence_common.stamps import to_nanoseconds

pytestmark = pytest.mark.system

PATIENCE_S = 90.0
RATE_HZ, STILL_FRAMES = 30.0, 60
LONG_NS = 0.5 * STILL_FRAMES / RATE_HZ * 1e9
# Prints the stamp [ns] of every frame.
READER = """
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_nanoseconds

rclpy.init()
node = Node("reader")
show = lambda message: print(to_nanoseconds(message.header.stamp), flush=True)
node.create_subscription(CompressedImage, "/left/image_raw/compressed", show, IMAGE_QOS)
rclpy.spin(node)
"""


@contextmanager
def running(argv: list[str]) -> Iterator["subprocess.Popen[str]"]:
    process = subprocess.Popen(argv, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "left.avi"
    writer = cv2.VideoWriter(str(path), cv2.CAP_OPENCV_MJPEG, cv2.VideoWriter.fourcc(*"MJPG"), RATE_HZ, (640, 480))
    for number in range(15):
        writer.write(np.full((480, 640, 3), 10 * number, np.uint8))
    writer.release()
    return path


class Watcher:
    """Reads the camera's own figures from /diagnostics."""

    def __init__(self, domain_id: int) -> None:
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=domain_id)
        self._node = Node("watcher", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._heard: list[tuple[int, dict[str, str]]] = []
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._take, 10)

    def _take(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "left/camera_node: camera":
                values = {entry.key: entry.value for entry in status.values}
                self._heard.append((to_nanoseconds(message.header.stamp), values))

    def values(self, after_ns: int, frames: int = 0) -> dict[str, str]:
        """Return the figures of a time [ns] after `after_ns` when at least so many frames had been published."""
        end_s = time.monotonic() + PATIENCE_S
        while not self._heard or self._heard[-1][0] <= after_ns or int(self._heard[-1][1]["frames"]) < frames:
            assert time.monotonic() < end_s, "the camera says nothing"
            self._executor.spin_once(timeout_sec=0.1)
        return self._heard[-1][1]

    def close(self) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture
def watcher(domain_id: int) -> Iterator[Watcher]:
    made = Watcher(domain_id)
    yield made
    made.close()


def test_a_reader_that_stands_still_costs_only_its_own_frames(watcher: Watcher, recording: Path) -> None:
    camera = NodeCommand("vergence_camera", "camera_node", {"device": str(recording)}, ["__ns:=/left"]).argv()
    with running([sys.executable, "-c", READER]) as reader, running(camera):
        assert reader.stdout is not None
        int(reader.stdout.readline())
        os.kill(reader.pid, signal.SIGSTOP)
        before = int(watcher.values(time.time_ns())["frames"])
        while_still = watcher.values(0, before + STILL_FRAMES)
        os.kill(reader.pid, signal.SIGCONT)
        stamps_ns = [int(reader.stdout.readline())]
        while len(stamps_ns) < before + 3 * STILL_FRAMES and np.ptp(stamps_ns[-2:]) < LONG_NS:
            stamps_ns.append(int(reader.stdout.readline()))
    assert while_still["reconnects"] == "0"
    assert np.diff(stamps_ns).max() > LONG_NS, "it was given what it had missed"
