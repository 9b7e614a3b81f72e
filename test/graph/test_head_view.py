"""The visual calibration's view of a running head: it commands, waits, and takes only images from after that."""

import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, Image, JointState
from std_msgs.msg import Header

from vergence_calibration.ros import head_view as head_view_node
from vergence_calibration.ros.head_view import HeadView
from vergence_calibration.ros.running_head import HeadError
from vergence_common.images import array_to_image
from vergence_common.qos import IMAGE_QOS

pytestmark = pytest.mark.graph


class GreyHead(Node):
    """Publishes both eyes' images, as bright as pan_left was last commanded in degrees."""

    def __init__(self, context: Context, listens: bool) -> None:
        super().__init__("grey_head", context=context)
        self.brightness = 0
        if listens:
            self.create_subscription(JointState, "joint_command", self._on_command, 10)
        self._images = {eye: self.create_publisher(Image, f"{eye}/image_raw", IMAGE_QOS) for eye in ("left", "right")}
        self._infos = {
            eye: self.create_publisher(CameraInfo, f"{eye}/camera_info", IMAGE_QOS) for eye in ("left", "right")
        }
        self.create_timer(0.03, self._publish)

    def _on_command(self, message: JointState) -> None:
        self.brightness = round(np.degrees(dict(zip(message.name, message.position, strict=True))["pan_left"]))

    def _publish(self) -> None:
        header = Header(stamp=self.get_clock().now().to_msg())
        for eye in ("left", "right"):
            self._images[eye].publish(array_to_image(np.full((8, 8, 3), self.brightness, np.uint8), header))
        focal = [500.0, 0.0, 4.0, 0.0, 500.0, 4.0, 0.0, 0.0, 1.0]
        self._infos["left"].publish(CameraInfo(header=header, width=8, height=8, k=focal, distortion_model="plumb_bob"))
        self._infos["right"].publish(CameraInfo(header=header, width=8, height=8))  # not calibrated


@pytest.fixture
def start_head(domain_id: int) -> Iterator[Callable[[bool], GreyHead]]:
    context = Context()
    rclpy.init(context=context)
    executor = SingleThreadedExecutor(context=context)

    def spin() -> None:
        try:
            executor.spin()
        except ExternalShutdownException:
            return

    thread = threading.Thread(target=spin, daemon=True)
    nodes: list[GreyHead] = []

    def start(listens: bool) -> GreyHead:
        nodes.append(GreyHead(context, listens))
        executor.add_node(nodes[0])
        thread.start()
        return nodes[0]

    yield start
    executor.shutdown()
    if thread.is_alive():
        thread.join(5)
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()


def test_images_are_from_after_the_move(start_head: Callable[[bool], GreyHead]):
    start_head(True)
    with HeadView() as view:
        for degrees in (7, 31, 2):
            before_s = time.time()
            images = view.look({"pan_left": float(np.radians(degrees))})
            assert {eye: int(image.mean()) for eye, image in images.items()} == {"left": degrees, "right": degrees}
            assert time.time() - before_s > 0.4
        models = view.camera_models()
        assert list(models) == ["left"]
        assert models["left"].width_px == 8


def test_nobody_to_command_and_rivals_are_named(
    start_head: Callable[[bool], GreyHead], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(head_view_node, "_TIMEOUT_S", 0.5)
    node = start_head(False)
    with HeadView() as view:
        with pytest.raises(HeadError, match="start servo_node"):
            view.look({})
        node.create_publisher(JointState, "joint_command", 10)
        deadline_s = time.monotonic() + 10
        while view.node.count_publishers("joint_command") < 2:
            assert time.monotonic() < deadline_s
            time.sleep(0.02)
        with pytest.raises(HeadError, match="gaze_controller_node"):
            view.look({})
