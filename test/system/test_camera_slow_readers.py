"""Readers that cannot keep up cost only their own frames: the camera goes on, and so does everybody else."""

import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from vergence_bringup.ros.processes import NodeCommand, environment

pytestmark = [pytest.mark.system, pytest.mark.timeout(1800)]

PATIENCE_S = 300.0
RATE_HZ, STILL_FRAMES = 30.0, 60
# A camera that waits for a reader does so for 0.1 s at least: as long as a write may block, or a frame takes below.
WAITING_S = 0.05
# Prints the stamp [s] of every frame.
READER = """
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_seconds

rclpy.init()
node = Node("reader")
show = lambda message: print(to_seconds(message.header.stamp), flush=True)
node.create_subscription(CompressedImage, "/left/image_raw/compressed", show, IMAGE_QOS)
rclpy.spin(node)
"""


class Reader:
    """A process that takes the frames; their stamps come through a pipe that never fills."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self.process = process
        self._stamps_s: queue.Queue[float] = queue.Queue()
        threading.Thread(target=self._take, daemon=True).start()

    def _take(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._stamps_s.put(float(line))

    def next_s(self, count: int = 1) -> list[float]:
        """Return the stamps of the next `count` frames that it gets."""
        return [self._stamps_s.get(timeout=PATIENCE_S) for _ in range(count)]


class Processes:
    """Real processes, each where it is started: on this machine, or in the network namespace of another."""

    def __init__(self) -> None:
        self._running: list[subprocess.Popen[str]] = []

    def camera(self, recording: Path, *where: str) -> None:
        command = NodeCommand.of("camera_node", {"device": str(recording)}, ["__ns:=/left"])
        self._run([*where, *command.argv()])

    def reader(self, *where: str) -> Reader:
        return Reader(self._run([*where, sys.executable, "-c", READER]))

    def _run(self, argv: list[str]) -> "subprocess.Popen[str]":
        self._running.append(
            subprocess.Popen(argv, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        )
        return self._running[-1]

    def close(self) -> None:
        for process in self._running:
            process.send_signal(signal.SIGCONT)
            process.terminate()
        for process in self._running:
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@pytest.fixture
def processes(domain_id: int) -> Iterator[Processes]:
    made = Processes()
    yield made
    made.close()


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A second of noise: pictures of about 45 kB, as a webcam's; one above 64 kB would be several datagrams."""
    path = tmp_path / "left.avi"
    random = np.random.default_rng(0)
    code, raw = cv2.VideoWriter.fourcc(*"MJPG"), [cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1]
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, RATE_HZ, (640, 480), raw)
    for _ in range(30):
        noise = cv2.resize(random.integers(0, 256, (240, 320, 3), dtype=np.uint8), (640, 480))
        writer.write(cv2.imencode(".jpg", noise, [cv2.IMWRITE_JPEG_QUALITY, 25])[1].reshape(1, -1))
    writer.release()
    assert 35e3 < path.stat().st_size / 30 < 60e3
    return path


def period_s(stamps_s: list[float]) -> float:
    return (stamps_s[-1] - stamps_s[0]) / (len(stamps_s) - 1)


def test_a_reader_that_stands_still_holds_up_nobody_and_then_catches_up(processes: Processes, recording: Path) -> None:
    lively, still = processes.reader(), processes.reader()
    processes.camera(recording)
    before_s = lively.next_s(30)
    stopped_s = still.next_s()[0]
    os.kill(still.process.pid, signal.SIGSTOP)
    lively_s = lively.next_s()
    while lively_s[-1] < stopped_s + STILL_FRAMES / RATE_HZ:
        lively_s += lively.next_s()
    os.kill(still.process.pid, signal.SIGCONT)
    still_s = [stopped_s]
    while still_s[-1] <= lively_s[-1] and len(still_s) < 4 * STILL_FRAMES:
        still_s += still.next_s()
    assert period_s(lively_s) < WAITING_S + 3.0 * period_s(before_s)
    assert still_s[-1] > lively_s[-1], "it goes on with old frames"
    assert all(np.diff(still_s) > 0.0)


def test_a_slow_network_holds_up_neither_the_camera_nor_the_readers_beside_it(
    processes: Processes, recording: Path, cable: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stream has 11 Mbit/s, the cable takes 1: at 0.4 s a frame, a camera that waits for it shows."""
    if shutil.which("tc") is None:
        pytest.skip("a slow network needs the tc command")
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    laptop, pi = (("ip", "netns", "exec", namespace) for namespace in (cable.laptop, cable.pi))
    beside = processes.reader(*laptop)
    processes.camera(recording, *laptop)
    before_s = beside.next_s(30)
    far = processes.reader(*pi)
    far.next_s(2)  # through a cable that is slow already, the frames would leave no room for what finds the reader
    try:
        cable.throttle("1mbit")
    except OSError as error:
        pytest.skip(f"this machine gives no slow network: {error}")
    far_s = far.next_s()
    while np.diff(far_s[-2:]).max(initial=0.0) <= 3.0 / RATE_HZ:  # what was on its way before the cable was slow
        far_s += far.next_s()
    beside_s = [0.0]
    while beside_s[-1] < far_s[-1]:
        beside_s += beside.next_s()
    beside_s = beside.next_s(60)
    far_s += far.next_s(3)
    assert period_s(beside_s) < WAITING_S + 3.0 * period_s(before_s)
    assert all(np.diff(far_s) > 0.0)
