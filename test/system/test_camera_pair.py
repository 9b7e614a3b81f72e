"""Two camera_node processes with the shipped YAML: one eye's trouble is not the other's, and every end is clean."""

import itertools
import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import CompressedImage

from vergence_bringup.ros.processes import NodeCommand, find_executable, find_node
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_nanoseconds

pytestmark = pytest.mark.system

TIMEOUT_S = 90.0
STALL_S = 0.5


def picture(number: int) -> bytes:
    x, y = np.meshgrid(np.arange(640) + 7 * number, np.arange(480))
    return bytes(cv2.imencode(".jpg", np.stack([x % 256, y % 256, (x * y) % 256], axis=2).astype(np.uint8))[1])


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "right.avi"
    writer = cv2.VideoWriter(str(path), cv2.CAP_OPENCV_MJPEG, cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (640, 480))
    for number in range(15):
        writer.write(np.full((480, 640, 3), 10 * number, np.uint8))
    writer.release()
    return path


class FaultyCamera:
    """An HTTP camera that sends three good frames, one damaged one, and then stalls or hangs up, in turns."""

    def __init__(self) -> None:
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}/"
        self.connections = 0
        self._ended = threading.Event()
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        while True:
            try:
                client, _ = self._socket.accept()
            except OSError:
                return
            self.connections += 1
            threading.Thread(target=self._answer, args=(client, self.connections % 2 == 0), daemon=True).start()

    def _answer(self, client: socket.socket, hang_up: bool) -> None:
        with client:
            client.recv(4096)
            try:
                client.sendall(b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=b\r\n\r\n")
                for data in (picture(0), picture(1), picture(2)[:5000], picture(3)):
                    client.sendall(b"--b\r\nContent-Length: %d\r\n\r\n" % len(data) + data + b"\r\n")
                    self._ended.wait(0.1)  # frames that wait together count as one: the newest
            except OSError:
                return
            if not hang_up:
                self._ended.wait(TIMEOUT_S)

    def close(self) -> None:
        self._ended.set()
        self._socket.close()


@pytest.fixture
def faulty() -> Iterator[FaultyCamera]:
    camera = FaultyCamera()
    yield camera
    camera.close()


Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(domain_id: int) -> Iterator[Start]:
    processes: list[subprocess.Popen[str]] = []

    def make(eye: str, device: str, *more: str, **parameters: object) -> "subprocess.Popen[str]":
        command = NodeCommand.of("camera_node", {"device": device, **parameters}, [f"__ns:=/{eye}"])
        arguments = [*command.argv(), *more]
        processes.append(subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
        return processes[-1]

    yield make
    for process in processes:
        process.terminate()
    for process in processes:
        try:
            process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


@pytest.fixture
def listener(domain_id: int) -> Iterator[Node]:
    context = Context()
    rclpy.init(args=[], context=context, domain_id=domain_id)
    node = Node("listener", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def spin(node: Node, done: Future) -> None:
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    try:
        executor.spin_until_future_complete(done, timeout_sec=TIMEOUT_S)
        assert done.done(), f"not within {TIMEOUT_S:g} s"
    finally:
        executor.remove_node(node)
        executor.shutdown()


def end(process: "subprocess.Popen[str]", number: int = signal.SIGINT) -> str:
    process.send_signal(number)
    _, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 0, errors
    return errors


def test_one_eye_reconnects_and_reconnects_while_the_other_never_waits(
    start: Start, listener: Node, faulty: FaultyCamera, recording: Path
) -> None:
    left = start("left", faulty.url, stall_timeout_s=STALL_S, **{"retry.first_s": 0.05, "retry.longest_s": 0.2})
    right = start("right", str(recording))
    stamps: dict[str, list[int]] = {"left": [], "right": []}
    counts: dict[str, str] = {}
    enough = Future()

    def count(name: str) -> int:
        return int(counts.get(name, 0))

    def right_frames_in_stalls() -> list[int]:
        """How many frames of the right eye lie in each silence of the left one that is long enough for a stall."""
        left_ns, right_ns = np.array(stamps["left"]), np.array(stamps["right"])
        silences = [pair for pair in itertools.pairwise(left_ns) if pair[1] - pair[0] > STALL_S * 1e9]
        return [int(((right_ns > begin) & (right_ns < end)).sum()) for begin, end in silences]

    def receive(eye: str, message: CompressedImage) -> None:
        stamps[eye].append(to_nanoseconds(message.header.stamp))

    def diagnose(message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "left/camera_node: camera":
                counts.update({entry.key: entry.value for entry in status.values})
        faults = count("fault.stalled") >= 2 and count("fault.disconnected") >= 2 and count("dropped_corrupt") >= 3
        # 15 frames of the right eye were due in 0.5 s; a machine that pauses holds up both.
        played_on = sum(number >= 5 for number in right_frames_in_stalls()) >= 2
        if faults and played_on and count("reconnects") >= 3 and not enough.done():
            enough.set_result(None)

    for eye in stamps:
        topic = f"/{eye}/image_raw/compressed"
        listener.create_subscription(CompressedImage, topic, lambda m, eye=eye: receive(eye, m), IMAGE_QOS)
    listener.create_subscription(DiagnosticArray, "/diagnostics", diagnose, 10)
    spin(listener, enough)

    for eye in stamps:
        assert all(before < after for before, after in itertools.pairwise(stamps[eye]))
    end(left)
    end(right, signal.SIGTERM)


def test_a_recording_played_once_is_seen_to_its_end_and_ends_well(
    start: Start, listener: Node, recording: Path
) -> None:
    content, last_came = recording.read_bytes(), Future()
    last_frame = content[content.rindex(b"\xff\xd8\xff") :]

    def receive(message: CompressedImage) -> None:
        if last_frame.startswith(bytes(message.data)) and not last_came.done():
            last_came.set_result(None)

    listener.create_subscription(CompressedImage, "/left/image_raw/compressed", receive, IMAGE_QOS)
    # Slow, so that discovery is over long before the last frame.
    process = start("left", str(recording), **{"replay.loop": False, "replay.rate_hz": 3.0})
    spin(listener, last_came)
    _, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 0, errors
    assert "recording has ended" in errors


@pytest.mark.parametrize(
    ("yaml", "words"),
    [
        ("{device: /none/clip.avi}", ["/none/clip.avi", "no such file"]),
        ("{width_px: 640}", ["device", "must be given"]),
        ("{device: clip.avi, width: 640}", ["width"]),
        ("{device: clip.avi, rate_hz: fast}", ["rate_hz", "fast"]),
        ("{device: 'ftp://camera'}", ["ftp"]),
    ],
)
def test_a_broken_yaml_ends_the_node_with_one_line(domain_id: int, tmp_path: Path, yaml: str, words: list[str]) -> None:
    file = tmp_path / "broken.yaml"
    file.write_text(f"/**:\n  ros__parameters: {yaml}\n")
    executable = str(find_node("camera_node"))
    result = subprocess.run(
        [executable, "--ros-args", "--params-file", str(file)], capture_output=True, text=True, timeout=TIMEOUT_S
    )
    assert result.returncode == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert all(word in result.stderr for word in words)


def test_a_camera_that_is_not_there_is_waited_for_with_the_reason(start: Start, listener: Node) -> None:
    process = start("left", "serial:NO-SUCH-CAMERA")
    heard = Future()

    def diagnose(message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "left/camera_node: camera" and not heard.done():
                heard.set_result(status)

    listener.create_subscription(DiagnosticArray, "/diagnostics", diagnose, 10)
    spin(listener, heard)
    status: DiagnosticStatus = heard.result()
    assert status.level == DiagnosticStatus.ERROR
    assert "NO-SUCH-CAMERA" in status.message
    end(process)


def test_list_cameras_runs_without_any() -> None:
    executable = str(find_executable("vergence_camera", "list_cameras"))
    result = subprocess.run([executable], capture_output=True, text=True, timeout=TIMEOUT_S)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip()
