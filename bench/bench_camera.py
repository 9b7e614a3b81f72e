"""Two Motion-JPEG streams through two camera nodes to one subscriber: frames lost, CPU time, delay.

The cameras are recordings played at 30 Hz; from the driver's buffer on, their frames are processed as a webcam's are.
The peer is a node that decodes each frame and encodes it again as JPEG (camera_transcoder.py).
"""

import contextlib
import itertools
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage

from bench.process_cost import cpu_s, end
from bench.results import Row
from vergence_bringup.ros.processes import NodeCommand, environment
from vergence_camera.sources.recordings import AviRecording
from vergence_common.domains import own_domain
from vergence_common.qos import IMAGE_QOS
from vergence_common.stamps import to_nanoseconds

RATE_HZ = 30
SIZES = {"": (640, 480), ".720p": (1280, 720)}
_WEBCAM_QUALITY = 75
_MEASURE_S = 10.0
_ROUNDS = 3
_START_S = 30.0
_EYES = ("left", "right")


@dataclass(frozen=True)
class Outcome:
    """One run of a pair: CPU seconds per second and stream, frames lost, the nodes' own delay."""

    cpu: float
    lost: float
    received: int
    stamp_to_publish_ms: float
    stamp_to_receive_ms: float


def run(say: Callable[[str], None]) -> list[Row]:
    """Measure both sizes, and the peer at each."""
    rows = []
    for suffix, size in SIZES.items():
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "webcam.avi"
            mean_kb = record(file, size)
            say(f"{size[0]}x{size[1]}: pictures of {mean_kb:.0f} kB on average")
            ours, peer = _in_turn(file, size, say)
        against = "decode and re-encode (OpenCV)"
        rows += [
            Row(f"camera.frames_lost{suffix}", ours.lost, "frames"),
            Row(f"camera.passthrough_cpu{suffix}", 100 * ours.cpu, "% of a core", against, 100 * peer.cpu),
            Row(f"camera.passthrough_cpu_ratio{suffix}", ours.cpu / peer.cpu, "of the peer's"),
            Row(f"camera.stamp_to_publish_ms{suffix}", ours.stamp_to_publish_ms, "ms"),
            Row(f"camera.stamp_to_receive_ms{suffix}", ours.stamp_to_receive_ms, "ms"),
        ]
    return rows


def _in_turn(file: Path, size: tuple[int, int], say: Callable[[str], None]) -> tuple[Outcome, Outcome]:
    """Measure camera_node and the peer alternately, so that other load affects both; return medians."""
    ours, peers = [], []
    for _ in range(_ROUNDS):
        ours.append(measure([_camera_node(eye, file, size) for eye in _EYES], file))
        peers.append(measure([_transcoder(eye, file) for eye in _EYES], file))
        say(f"camera_node {100 * ours[-1].cpu:.2f} % of a core per stream, {ours[-1].lost:g} frames lost")
        say(f"decode and re-encode {100 * peers[-1].cpu:.2f} %, {peers[-1].received} frames")
    return _median(ours), _median(peers)


def _median(outcomes: Sequence[Outcome]) -> Outcome:
    """Return the median of the CPU times and delays, and all that was received and lost."""
    return Outcome(
        cpu=statistics.median(outcome.cpu for outcome in outcomes),
        lost=sum(outcome.lost for outcome in outcomes),
        received=sum(outcome.received for outcome in outcomes),
        stamp_to_publish_ms=statistics.median(outcome.stamp_to_publish_ms for outcome in outcomes),
        stamp_to_receive_ms=statistics.median(outcome.stamp_to_receive_ms for outcome in outcomes),
    )


def record(path: Path, size_px: tuple[int, int], frames: int = 90) -> float:
    """Write a Motion-JPEG AVI of a textured, moving scene with sensor noise; return the mean picture in kB.

    The pictures are as large as a webcam's, and like a webcam's they all have one header: ffmpeg's own encoder would
    give each picture tables of its own.
    """
    width, height = size_px
    random = np.random.default_rng(0)
    scene = random.integers(0, 256, (height // 16, width // 16 + 60, 3), dtype=np.uint8)
    scene = cv2.resize(scene, None, fx=16, fy=16, interpolation=cv2.INTER_CUBIC)
    encoded_already = [cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1]
    mjpg = cv2.VideoWriter.fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, mjpg, RATE_HZ, size_px, encoded_already)
    for number in range(frames):
        shift = 4 * number
        picture: npt.NDArray[np.int16] = scene[:height, shift : shift + width].astype(np.int16)
        noisy = np.clip(picture + random.normal(0.0, 3.0, picture.shape).astype(np.int16), 0, 255).astype(np.uint8)
        writer.write(cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, _WEBCAM_QUALITY])[1].reshape(1, -1))
    writer.release()
    return path.stat().st_size / frames / 1e3


def measure(commands: Sequence[Sequence[str]], file: Path, duration_s: float = _MEASURE_S) -> Outcome:
    """Run the commands as the two eyes, subscribe to both, and measure once both have settled.

    A frame is lost if its image in `file` never arrives although later ones do; for re-encoded images this is unknown
    (NaN).
    """
    numbers = {bytes(picture): number for number, picture in enumerate(AviRecording(file).pictures())}
    with own_domain() as domain, contextlib.ExitStack() as stack:
        context = Context()
        rclpy.init(args=[], context=context, domain_id=domain)
        stack.callback(context.try_shutdown)
        subscriber = Subscriber(context, numbers)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(subscriber)
        processes = [stack.enter_context(_running(command, domain)) for command in commands]
        _spin(executor, lambda: all(len(subscriber.pictures[eye]) > RATE_HZ for eye in _EYES), _START_S)
        subscriber.clear()
        before, began = [cpu_s(process.pid) for process in processes], time.monotonic()
        _spin(executor, lambda: time.monotonic() - began > duration_s, duration_s + 5.0)
        elapsed = time.monotonic() - began
        cpu = [(cpu_s(p.pid) - b) / elapsed for p, b in zip(processes, before, strict=True)]
        outcome = Outcome(
            cpu=statistics.mean(cpu),
            lost=sum(_missing(pictures, len(numbers)) for pictures in subscriber.pictures.values())
            if all(-1 not in pictures for pictures in subscriber.pictures.values())
            else float("nan"),
            received=sum(len(pictures) for pictures in subscriber.pictures.values()),
            stamp_to_publish_ms=max(subscriber.publish_ms.values(), default=float("nan")),
            stamp_to_receive_ms=1e3 * statistics.median(subscriber.delays_s),
        )
        executor.shutdown()
        subscriber.destroy_node()
    return outcome


class Subscriber(Node):
    """The one subscriber of both streams. `numbers` maps the pictures' bytes to their place in the recording."""

    def __init__(self, context: Context, numbers: Mapping[bytes, int]) -> None:
        super().__init__("bench_camera", context=context)
        self._numbers = numbers
        self.pictures: dict[str, list[int]] = {eye: [] for eye in _EYES}
        self.delays_s: list[float] = []
        self.publish_ms: dict[str, float] = {}
        for eye in _EYES:
            self.create_subscription(
                CompressedImage, f"/{eye}/image_raw/compressed", lambda m, eye=eye: self._on_image(eye, m), IMAGE_QOS
            )
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    def clear(self) -> None:
        """Discard everything received so far."""
        for pictures in self.pictures.values():
            pictures.clear()
        self.delays_s.clear()
        self.publish_ms.clear()

    def _on_image(self, eye: str, message: CompressedImage) -> None:
        stamp_ns = to_nanoseconds(message.header.stamp)
        self.delays_s.append((time.time_ns() - stamp_ns) * 1e-9)
        self.pictures[eye].append(self._numbers.get(bytes(message.data), -1))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            for entry in status.values:
                if entry.key == "stamp_to_publish_ms":
                    self.publish_ms[status.name] = float(entry.value)


def _missing(pictures: Sequence[int], count: int) -> int:
    """Return how many images of a loop of `count` are missing between the received ones, by their numbers."""
    return sum((after - before - 1) % count for before, after in itertools.pairwise(pictures))


def _camera_node(eye: str, file: Path, size: tuple[int, int]) -> list[str]:
    parameters = {"device": str(file), "width_px": size[0], "height_px": size[1]}
    return NodeCommand.of("camera_node", parameters, [f"__ns:=/{eye}"]).argv()


def _transcoder(eye: str, file: Path) -> list[str]:
    return [
        *(sys.executable, "-m", "bench.camera_transcoder", str(file), str(RATE_HZ)),
        *("--ros-args", "-r", f"__ns:=/{eye}"),
    ]


@contextlib.contextmanager
def _running(command: Sequence[str], domain: int) -> "Iterator[subprocess.Popen[bytes]]":
    env = environment({"ROS_DOMAIN_ID": str(domain)})
    process = subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        end(process, 10.0)


def _spin(executor: SingleThreadedExecutor, until: Callable[[], bool], timeout_s: float) -> None:
    end_s = time.monotonic() + timeout_s
    while not until():
        if time.monotonic() > end_s:
            raise TimeoutError(f"the streams did not come within {timeout_s:g} s")
        executor.spin_once(timeout_sec=0.1)
