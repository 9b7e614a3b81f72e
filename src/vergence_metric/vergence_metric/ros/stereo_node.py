"""Base of the nodes that measure pairs of images: joint history, stage times, and the report of a failed pair."""

import os
import traceback
from typing import Any

import cv2
from rclpy.node import Node
from sensor_msgs.msg import JointState

from vergence_common.blas_threads import limit_blas_threads
from vergence_common.local_images import LocalImages
from vergence_common.stamps import to_nanoseconds
from vergence_metric.pairs.latest_worker import LatestWorker
from vergence_metric.pairs.stage_times import StageTimes
from vergence_rig.joint_history import JointHistory


def limit_threads(count: int) -> None:
    """Let OpenCV and BLAS use at most `count` threads for one operation; 0 is one for each core."""
    cv2.setNumThreads(count or -1)
    limit_blas_threads(count or os.cpu_count() or 1)


class StereoNode(Node):
    """Measures pairs on its own thread. Subclasses must set `_worker`, and clear `_failure` after a measured pair."""

    _worker: LatestWorker[Any]

    def __init__(self, name: str, images: LocalImages | None = None, **options: Any) -> None:
        super().__init__(name, **options)
        self._images = images
        self._joints = JointHistory()
        self._times = StageTimes()
        self._failure: str | None = None

    def close(self) -> None:
        """End the measuring thread."""
        self._worker.close()

    def _on_joints(self, message: JointState) -> None:
        self._joints.add(to_nanoseconds(message.header.stamp), message.name, message.position)

    def _on_failure(self, error: Exception) -> None:
        if not self.context.ok():
            return  # shut down while a pair was being measured
        self._failure = f"{type(error).__name__}: {error}"
        text = "".join(traceback.format_exception(error))
        self.get_logger().error(f"measuring a pair failed:\n{text}", throttle_duration_sec=10.0)
