"""The peer of camera_node: OpenCV decodes every frame and encodes it again as JPEG.

`python -m bench.camera_transcoder FILE RATE_HZ --ros-args -r __ns:=/left`: same topic, images and rate as
camera_node, so that the two differ in decoding and encoding only.
"""

import sys

import cv2
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from vergence_common.images import array_to_compressed
from vergence_common.qos import IMAGE_QOS

_QUALITY = 80


class Transcoder(Node):
    """Publishes a video file, one frame per timer tick."""

    def __init__(self, path: str, rate_hz: float) -> None:
        super().__init__("transcoder")
        self._path, self._capture = path, cv2.VideoCapture(path)
        self._publisher = self.create_publisher(CompressedImage, "image_raw/compressed", IMAGE_QOS)
        self.create_timer(1.0 / rate_hz, self._tick)

    def _tick(self) -> None:
        done, pixels = self._capture.read()
        if not done:
            self._capture = cv2.VideoCapture(self._path)
            return
        header = Header(stamp=self.get_clock().now().to_msg())
        message = array_to_compressed(np.asarray(pixels, dtype=np.uint8), header, _QUALITY)
        self._publisher.publish(message)


def main() -> int:
    """Run until a signal comes."""
    cv2.setNumThreads(1)
    rclpy.init()
    node = Transcoder(sys.argv[1], float(sys.argv[2]))
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
