"""A client of a running head: commands joints over joint_command, receives the cameras' calibrations."""

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
from vergence_common.start import checked_namespace, init
from vergence_rig.camera import CameraModel, CameraModelError

EYES = ("left", "right")
REPEAT_S = 0.02

Self = TypeVar("Self", bound="RunningHead")


class HeadError(ValueError):
    """A head that cannot be used: no node subscribes to commands, another node publishes them, or no images come."""


class RunningHead:
    """A node in a thread of its own. Commands are repeated 50 times a second, so that the servos do not time out.

    With `own_signals` the caller handles Ctrl-C: the node lives until the end of the block, for clean-up.
    """

    def __init__(self, name: str, namespace: str = "", own_signals: bool = False) -> None:
        init([], signal_handler_options=SignalHandlerOptions.NO if own_signals else None)
        self.node = Node(name, namespace=checked_namespace(namespace))
        self.arrival = threading.Condition()
        """Held while received data is changed or read, and notified after every change."""
        self._infos: dict[str, CameraInfo] = {}
        self._commanded_rad: dict[str, float] = {}
        self.sending = threading.Lock()
        """Held while a command is stamped and published."""
        self._command = self.node.create_publisher(JointState, "joint_command", STATE_QOS)
        for eye in EYES:
            self.node.create_subscription(
                CameraInfo, f"{eye}/camera_info", lambda message, eye=eye: self._infos.update({eye: message}), IMAGE_QOS
            )
        self.node.create_timer(REPEAT_S, self._repeat_command)
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
        # the thread ends first: an executor that is shut down while it waits raises
        self._ending.set()
        self._thread.join(timeout=10.0)
        self._executor.shutdown(timeout_sec=1.0)
        self.node.destroy_node()
        rclpy.try_shutdown()

    def now_s(self) -> float:
        """Return the node's time [s]."""
        return float(self.node.get_clock().now().nanoseconds) * 1e-9

    def command(self, joints_rad: Mapping[str, float]) -> float:
        """Command joints [rad] from now on; return the command's stamp [s]. Empty: stop sending."""
        with self.sending:
            self._commanded_rad = dict(joints_rad)
            return self._publish()

    def published_models(self) -> dict[str, CameraModel]:
        """Return the models of the cameras that publish a calibration."""
        models = {}
        for eye, info in list(self._infos.items()):
            try:
                models[eye] = CameraModel.from_camera_info_values(
                    info.width, info.height, list(info.k), list(info.d), info.distortion_model
                )
            except CameraModelError:
                continue  # not calibrated: the rig's values are used
        return models

    def wait_for_servos(self, timeout_s: float) -> None:
        """Wait until another node subscribes to commands. Raises HeadError."""
        deadline_s = time.monotonic() + timeout_s
        while not self._subscribers():
            if time.monotonic() > deadline_s:
                raise HeadError("no node subscribes to joint_command: start servo_node (or sim_node) first")
            time.sleep(0.05)

    def on_command_sent(self, stamp_ns: int) -> None:
        """Called before a command with this stamp is published."""

    def _subscribers(self) -> list[str]:
        infos = self.node.get_subscriptions_info_by_topic(self._command.topic_name)
        return [info.node_name for info in infos if info.node_name != self.node.get_name()]

    def _repeat_command(self) -> None:
        with self.sending:
            if self._commanded_rad:
                self._publish()

    def _publish(self) -> float:
        # Stamped under the lock: servo_node refuses stamps that decrease.
        stamp = self.node.get_clock().now().to_msg()
        if self._commanded_rad:
            message = JointState(name=list(self._commanded_rad), position=list(self._commanded_rad.values()))
            message.header.stamp = stamp
            self.on_command_sent(to_nanoseconds(stamp))
            self._command.publish(message)
        return to_nanoseconds(stamp) * 1e-9

    def _spin(self) -> None:
        try:
            while not self._ending.is_set():
                self._executor.spin_once(timeout_sec=0.1)
        except ExternalShutdownException:
            return
