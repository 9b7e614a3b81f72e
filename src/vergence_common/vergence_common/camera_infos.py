"""The subscription of a camera_info, which comes with every image and hardly ever changes."""

from collections.abc import Callable

from rclpy.node import Node
from rclpy.qos import QoSProfile, QoSReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo

from vergence_common.polled_subscription import PolledSubscription
from vergence_common.qos import QosWatch
from vergence_common.stamps import STAMP_END

# camera_info is repeated with every image; best effort is compatible with every publisher.
_QOS = QoSProfile(depth=1, reliability=QoSReliabilityPolicy.BEST_EFFORT)


class CameraInfoInput(PolledSubscription):
    """Keeps the newest message until it is asked for: `poll` is to be called at the owner's own pace.

    It calls `on_change` with the first message, and with one that differs from it in more than its stamp.
    """

    def __init__(self, node: Node, watch: QosWatch, topic: str, on_change: Callable[[CameraInfo], None]) -> None:
        self._on_change, self._before = on_change, b""
        super().__init__(node, watch, CameraInfo, topic, self._on_serialised, _QOS, serialised=True)

    def _on_serialised(self, message: bytes) -> None:
        if message[STAMP_END:] != self._before:
            self._before = message[STAMP_END:]
            self._on_change(deserialize_message(message, CameraInfo))
