"""The subscription of a camera_info, which comes with every image and hardly ever changes."""

from collections.abc import Callable

from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo

from vergence_common.qos import STATE_QOS, QosWatch
from vergence_common.stamps import STAMP_END


def subscribe_camera_info(
    watch: QosWatch, topic: str, on_change: Callable[[CameraInfo], None], qos: QoSProfile = STATE_QOS
) -> Subscription:
    """Call `on_change` with the first message and with each that differs from the one before in more than its stamp.

    The others are compared as they were sent: to make a message of each would cost a core a per cent for each camera.
    """
    before = b""

    def on_message(sent: bytes) -> None:
        nonlocal before
        if sent[STAMP_END:] != before:
            before = sent[STAMP_END:]
            on_change(deserialize_message(sent, CameraInfo))

    return watch.create_subscription(CameraInfo, topic, on_message, qos, serialised=True)
