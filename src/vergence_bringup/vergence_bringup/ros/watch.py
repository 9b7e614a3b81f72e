"""`vergence watch`: a live view of a running graph in the terminal; it needs rclpy, not the ros2 command."""

import argparse
import select
import shutil
import sys
import termios
import time
import tty
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, JointState

from vergence_bringup.figures.watch_screen import Screen, Snapshot
from vergence_common.qos import IMAGE_QOS, STATE_QOS
from vergence_common.stamps import to_seconds
from vergence_common.start import checked_namespace, init
from vergence_msgs.msg import BoxVergence, EdgeVergence, GazeState, VergenceError
from vergence_rig.rig_file import load_rig
from vergence_rig.stream import Stream

# camera_info is published with every image and is cheap: it shows whether images arrive.
_TOPICS: dict[str, tuple[Any, Any]] = {
    "left/camera_info": (CameraInfo, IMAGE_QOS),
    "right/camera_info": (CameraInfo, IMAGE_QOS),
    "vergence/edge": (EdgeVergence, STATE_QOS),
    "vergence/error": (VergenceError, STATE_QOS),
    "vergence/box": (BoxVergence, STATE_QOS),
    "gaze/state": (GazeState, STATE_QOS),
    "joint_command": (JointState, STATE_QOS),
    "joint_states": (JointState, STATE_QOS),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `vergence watch`."""
    parser.add_argument("--namespace", default="", help="namespace of the head (default: none)")
    parser.add_argument(
        "--rig", default="", help="path of rig.yaml, for the joints' limits (default: the built-in rig)"
    )
    parser.add_argument(
        "--rate", type=_rate, default=5.0, metavar="HZ", help="redraws per second (default: %(default)s)"
    )
    parser.add_argument("--once", type=float, metavar="S", help="receive for S seconds, print one view and exit")


def _rate(text: str) -> float:
    value = float(text)
    if not 0.2 <= value <= 30:
        raise argparse.ArgumentTypeError(f"must be 0.2 to 30: got {text}")
    return value


class GraphMonitor(Node):
    """Keeps the newest message of every topic, its arrival and its rate."""

    def __init__(self, namespace: str) -> None:
        super().__init__("vergence_watch", namespace=checked_namespace(namespace))
        self.streams = {topic: Stream() for topic in _TOPICS}
        self.health: dict[str, tuple[int, str, float]] = {}
        for topic, (kind, qos) in _TOPICS.items():
            self.create_subscription(kind, topic, self._add_to(self.streams[topic]), qos)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self._simulated_s: float | None = None
        best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(Clock, "/clock", self._on_clock, best_effort)

    def snapshot(self) -> Snapshot:
        """Return the state now; stamps are of simulated time where /clock is published."""
        now_s = time.time() if self._simulated_s is None else self._simulated_s
        return Snapshot(time.monotonic(), now_s, self.streams, self.health)

    def _on_clock(self, message: Clock) -> None:
        self._simulated_s = to_seconds(message.clock)

    def _add_to(self, stream: Stream) -> Any:
        return lambda message: stream.add(message, time.monotonic())

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.health[status.name] = (status.level[0], status.message, time.monotonic())


def run(options: argparse.Namespace) -> int:
    """Show the graph until q or Ctrl-C; with --once return 1 if no message arrived."""
    screen = Screen(_limits(options.rig))
    init()
    node = GraphMonitor(options.namespace)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        if options.once is not None:
            _spin_for(executor, options.once)
            print("\n".join(screen.lines(node.snapshot(), _width(), colour=sys.stdout.isatty())))
            return 0 if any(stream.count for stream in node.streams.values()) else 1
        _live(screen, node, executor, 1.0 / options.rate)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def _limits(path: str) -> Mapping[str, tuple[float, float]]:
    return {name: (joint.lower_rad, joint.upper_rad) for name, joint in load_rig(path).joints.items()}


def _width() -> int:
    return shutil.get_terminal_size((100, 40)).columns


def _spin_for(executor: SingleThreadedExecutor, duration_s: float) -> None:
    deadline_s = time.monotonic() + duration_s
    while (left_s := deadline_s - time.monotonic()) > 0:
        executor.spin_once(timeout_sec=left_s)


def _live(screen: Screen, node: GraphMonitor, executor: SingleThreadedExecutor, period_s: float) -> None:
    with _keys_without_enter(), _alternate_screen():
        while True:
            _spin_for(executor, period_s)
            lines = screen.lines(node.snapshot(), _width(), colour=True)
            height = shutil.get_terminal_size((100, 40)).lines
            sys.stdout.write("\033[H" + "".join(f"{line}\033[K\n" for line in lines[: height - 1]) + "\033[J")
            sys.stdout.flush()
            if _key() in ("q", "Q", "\x1b"):
                return


@contextmanager
def _alternate_screen() -> Iterator[None]:
    """Draw on the terminal's alternate screen, without a cursor; restore the normal one afterwards."""
    sys.stdout.write("\033[?1049h\033[?25l\033[2J")
    try:
        yield
    finally:
        sys.stdout.write("\033[?25h\033[?1049l")
        sys.stdout.flush()


@contextmanager
def _keys_without_enter() -> Iterator[None]:
    if not sys.stdin.isatty():
        yield
        return
    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield
    finally:
        with suppress(termios.error):
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _key() -> str:
    if sys.stdin.isatty() and select.select([sys.stdin], [], [], 0)[0]:
        return sys.stdin.read(1)
    return ""
