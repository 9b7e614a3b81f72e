"""Points of messages in rig_base: the head's own frames by its joints, any other by tf2 where that is installed."""

import math
from typing import Any

from rclpy.node import Node
from rclpy.time import Time

from vergence_common.stamps import to_seconds
from vergence_gaze.control.controller import GazeController
from vergence_gaze.joints.frames import FrameError
from vergence_gaze.ros.gaze_messages import BASE_FRAME, transformed_point

_LONGEST_TF_LAG_S = 0.2


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
            return self._by_tf(point, frame, stamp_s)

    def _by_tf(self, point: Any, frame: str, stamp_s: float) -> tuple[float, float, float]:
        from tf2_ros import TransformException

        try:
            transform = self._transform_at(frame, stamp_s)
        except TransformException as error:
            raise FrameError(f"the frame must be connected to {BASE_FRAME}: got {frame!r}: {error}") from error
        return transformed_point(transform, point)

    def _transform_at(self, frame: str, stamp_s: float) -> Any:
        """Return the transform at a stamp (NaN: the newest); tf may lag behind a fresh point by a little."""
        from tf2_ros import ExtrapolationException

        if not math.isfinite(stamp_s):
            return self._buffer.lookup_transform(BASE_FRAME, frame, Time()).transform
        try:
            return self._buffer.lookup_transform(BASE_FRAME, frame, Time(nanoseconds=round(stamp_s * 1e9))).transform
        except ExtrapolationException:
            newest = self._buffer.lookup_transform(BASE_FRAME, frame, Time())
            if 0.0 <= stamp_s - to_seconds(newest.header.stamp) <= _LONGEST_TF_LAG_S:
                return newest.transform
            raise


def _tf_buffer(node: Node) -> Any:
    """Return a tf2 buffer with a listener, or None where tf2 is not installed."""
    try:
        from tf2_ros import Buffer, TransformListener
    except ImportError:
        return None
    buffer = Buffer()
    buffer.listener = TransformListener(buffer, node)
    return buffer
