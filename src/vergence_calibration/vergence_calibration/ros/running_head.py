"""A running head from outside: joints told over joint_command, camera calibrations heard."""

import threading
import time
from collections.abc import Mapping
from types import TracebackType
from typing import TypeVar

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import CameraInfo, JointState

from vergence_common.qos import IMAGE_QOS, STATE_QOS
from vergence_common.stamps import to_nanoseconds
from vergence_rig.camera import CameraModel, CameraModelError

EYES = ("left", "right")
REPEAT_S = 0.02

Self = TypeVar("Self", bound="RunningHead")


class HeadError(ValueError):
    """A head that cannot be used: nobody takes commands, somebody else gives them, or no images come."""


class RunningHead:
    """A node in a thread of its own. Commands are repeated 50 times a second, so that the servos do not time out.

    With `own_signals` Ctrl-C stays the caller's: the node lives until the end of the block, to clean up with.
    """

    def __init__(self, name: str, namespace: str = "", own_signals: bool = False) -> None:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO if own_signals else None)
        self.node = Node(name, namespace=namespace or None)
        self.arrival = threading.Condition()
        """Held while what came is changed or read, and notified after every change."""
        self._infos: dict[str, CameraInfo] = {}
        self._wanted_rad: dict[str, float] = {}
        self.telling = threading.Lock()
        """Held while a command is stamped and published."""
        self._command = self.node.create_publisher(JointState, "joint_command", STATE_QOS)
        for eye in EYES:
            self.node.create_subscription(
                CameraInfo, f"{eye}/camera_info", lambda message, eye=eye: self._infos.update({eye: message}), IMAGE_QOS
            )
        self.node.create_timer(REPEAT_S, self._tell)
        self._ending = threading.Event()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, name=name, daemon=True)

    def __enter__(self: Self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # first the thread: an executor that is shut down under it fails in the middle of its waiting
        self._ending.set()
        self._thread.join(timeout=10.0)
        self._executor.shutdown(timeout_sec=1.0)
        self.node.destroy_node()
        rclpy.try_shutdown()

    def now_s(self) -> float:
        """Return the node's time [s]."""
        return float(self.node.get_clock().now().nanoseconds) * 1e-9

    def tell(self, joints_rad: Mapping[str, float]) -> float:
        """Command joints [rad] now and until told otherwise; return the command's stamp [s]. Empty: say nothing."""
        with self.telling:
            self._wanted_rad = dict(joints_rad)
            return self._publish()

    def heard_models(self) -> dict[str, CameraModel]:
        """Return the models of the cameras that publish a calibration."""
        models = {}
        for eye, info in list(self._infos.items()):
            try:
                models[eye] = CameraModel.from_camera_info_values(
                    info.width, info.height, list(info.k), list(info.d), info.distortion_model
                )
            except CameraModelError:
                continue  # not calibrated: the rig's figures do
        return models

    def wait_for_servos(self, patience_s: float) -> None:
        """Wait until somebody else takes commands. Raises HeadError."""
        deadline_s = time.monotonic() + patience_s
        while not self._takers():
            if time.monotonic() > deadline_s:
                raise HeadError("nobody takes joint_command: start servo_node (or sim_node) first")
            time.sleep(0.05)

    def on_told(self, stamp_ns: int) -> None:
        """Know that a command with this stamp goes out now."""

    def _takers(self) -> list[str]:
        infos = self.node.get_subscriptions_info_by_topic(self._command.topic_name)
        return [info.node_name for info in infos if info.node_name != self.node.get_name()]

    def _tell(self) -> None:
        with self.telling:
            if self._wanted_rad:
                self._publish()

    def _publish(self) -> float:
        # Stamped under the lock: servo_node refuses stamps that run backwards.
        stamp = self.node.get_clock().now().to_msg()
        if self._wanted_rad:
            message = JointState(name=list(self._wanted_rad), position=list(self._wanted_rad.values()))
            message.header.stamp = stamp
            self.on_told(to_nanoseconds(stamp))
            self._command.publish(message)
        return to_nanoseconds(stamp) * 1e-9

    def _spin(self) -> None:
        try:
            while not self._ending.is_set():
                self._executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            return
