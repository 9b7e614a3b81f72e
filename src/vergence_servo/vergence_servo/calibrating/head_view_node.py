"""The running head, as the visual calibration needs it: joints told over joint_command, images from the topics."""

import threading
import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image, JointState

from vergence_common.images import image_to_array
from vergence_common.qos import IMAGE_QOS, STATE_QOS
from vergence_common.stamps import to_nanoseconds
from vergence_rig.camera import CameraError, CameraModel
from vergence_rig.rig import JOINT_NAMES
from vergence_servo.calibration import CalibrationError
from vergence_servo.image_motion import Image as Pixels

_EYES = ("left", "right")
_SETTLE_S = 0.5
_PATIENCE_S = 15.0
_FIRST_PATIENCE_S = 45.0


class HeadView:
    """A node in a thread of its own. Commands are repeated 50 times a second, so that the servos do not time out."""

    def __init__(self, namespace: str = "") -> None:
        rclpy.init()
        self._node = Node("calibrate_servos", namespace=namespace or None)
        self._arrival = threading.Condition()
        self._images: dict[str, Image] = {}
        self._cameras: dict[str, CameraInfo] = {}
        self._wanted_rad: dict[str, float] = {}
        self._command = self._node.create_publisher(JointState, "joint_command", STATE_QOS)
        for eye in _EYES:
            self._node.create_subscription(Image, f"{eye}/image_raw", self._into(self._images, eye), IMAGE_QOS)
            self._node.create_subscription(CameraInfo, f"{eye}/camera_info", self._into(self._cameras, eye), IMAGE_QOS)
        self._node.create_timer(0.02, self._tell)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name="head view", daemon=True)
        self._thread.start()

    def __enter__(self) -> "HeadView":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown(timeout_sec=1.0)
        self._thread.join(timeout=2.0)
        self._node.destroy_node()
        rclpy.try_shutdown()

    def camera_models(self) -> dict[str, CameraModel]:
        """Return the models of the cameras that publish a calibration."""
        self._wait_for_images(0, _FIRST_PATIENCE_S)
        models = {}
        for eye, info in self._cameras.items():
            try:
                models[eye] = CameraModel.from_camera_info_values(
                    info.width, info.height, list(info.k), list(info.d), info.distortion_model
                )
            except CameraError:
                continue  # not calibrated: the rig's figures do
        return models

    def look(self, joints_rad: Mapping[str, float]) -> dict[str, Pixels]:
        """Command the joints, wait until the eyes rest, return both eyes' images taken after that.

        Raises CalibrationError where nobody takes commands or no images come.
        """
        if self._node.count_publishers("joint_command") > 1:
            raise CalibrationError("somebody else commands the joints: stop gaze_controller_node first")
        if not self._command.get_subscription_count():
            self._wait_for_servos()
        self._wanted_rad = {name: joints_rad.get(name, 0.0) for name in JOINT_NAMES}
        time.sleep(_SETTLE_S)
        return self._wait_for_images(self._node.get_clock().now().nanoseconds)

    def _wait_for_servos(self) -> None:
        deadline_s = time.monotonic() + _PATIENCE_S
        while not self._command.get_subscription_count():
            if time.monotonic() > deadline_s:
                raise CalibrationError("nobody takes joint_command: start servo_node (or sim_node) first")
            time.sleep(0.05)

    def _wait_for_images(self, after_ns: int, patience_s: float = _PATIENCE_S) -> dict[str, Pixels]:
        def fresh() -> bool:
            stamps = [to_nanoseconds(self._images[eye].header.stamp) for eye in _EYES if eye in self._images]
            return len(stamps) == len(_EYES) and min(stamps) > after_ns

        with self._arrival:
            if not self._arrival.wait_for(fresh, patience_s):
                raise CalibrationError(f"no fresh left/image_raw and right/image_raw for {patience_s:g} s")
            return {eye: image_to_array(image) for eye, image in self._images.items()}

    def _into(self, store: dict[str, Any], eye: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            with self._arrival:
                store[eye] = message
                self._arrival.notify_all()

        return take

    def _tell(self) -> None:
        if self._wanted_rad:
            message = JointState(name=list(self._wanted_rad), position=list(self._wanted_rad.values()))
            message.header.stamp = self._node.get_clock().now().to_msg()
            self._command.publish(message)

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return
