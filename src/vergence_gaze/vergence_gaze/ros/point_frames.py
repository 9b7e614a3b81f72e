"""Points of messages in rig_base: the head's own frames by its joints, any other by tf2 where that is installed."""

from typing import Any

from rclpy.node import Node
from rclpy.time import Time

from vergence_gaze.control.controller import GazeController
from vergence_gaze.joints.frames import FrameError
from vergence_gaze.ros.gaze_messages import BASE_FRAME, transformed_point


class PointFrames:
    """Transforms points for a controller."""

    def __init__(self, node: Node, controller: GazeController) -> None:
        self._controller = controller
        self._buffer: Any = _tf_buffer(node)

    def in_rig(self, point: Any, frame: str, stamp_s: float) -> tuple[float, float, float]:
        """Return a geometry_msgs/Point of `frame` at `stamp_s` in rig_base [m]; raises FrameError."""
        try:
            return self._controller.frame_to_rig((point.x, point.y, point.z), frame, stamp_s)
        except FrameError:
            if self._buffer is None:
                raise
            return self._by_tf(point, frame)

    def _by_tf(self, point: Any, frame: str) -> tuple[float, float, float]:
        from tf2_ros import TransformException

        try:
            transform = self._buffer.lookup_transform(BASE_FRAME, frame, Time()).transform
        except TransformException as error:
            raise FrameError(f"the frame must be connected to {BASE_FRAME}: got {frame!r}: {error}") from error
        return transformed_point(transform, point)


def _tf_buffer(node: Node) -> Any:
    """Return a tf2 buffer with a listener, or None where tf2 is not installed."""
    try:
        from tf2_ros import Buffer, TransformListener
    except ImportError:
        return None
    buffer = Buffer()
    buffer.listener = TransformListener(buffer, node)
    return buffer
