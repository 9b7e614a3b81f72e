"""What the nodes that measure pairs of images share: the joints' history, and a thread whose failures are told."""

import traceback
from typing import Any

from rclpy.node import Node
from sensor_msgs.msg import JointState

from vergence_common.stamps import to_nanoseconds
from vergence_metric.pairs.joint_history import JointHistory
from vergence_metric.pairs.latest_worker import LatestWorker
from vergence_metric.pairs.stage_times import StageTimes


class PairNode(Node):
    """Measures pairs on a thread of its own; `_worker` is the heir's, which clears `_failure` after a good pair."""

    _worker: LatestWorker[Any]

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
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
        self.get_logger().error(f"a pair could not be measured:\n{text}", throttle_duration_sec=10.0)
