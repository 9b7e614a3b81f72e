"""Reads what a head's eyes and joints were in a bag: of `vergence record`, `Head.record` or `ros2 bag record`."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_typestore

from vergence.bags.topics import SIDES
from vergence.bags.writer import BagError
from vergence.body import JointAngles, Picture, Pixels
from vergence_metric.pairs.pairing import LEFT, RIGHT
from vergence_metric.tracking.request import TrackRequest
from vergence_rig.camera import CameraModel, CameraModelError
from vergence_rig.picture_file import decode_picture
from vergence_rig.regular_file import FileError
from vergence_rig.rig import JOINT_NAMES

_CHANNELS = {"bgr8": (3, None), "rgb8": (3, cv2.COLOR_RGB2BGR), "mono8": (1, None)}


@dataclass(frozen=True)
class RecordedMetric:
    """The figures of metric I that the head published of one pair, by the stamp of its left picture [ns]."""

    stamp_ns: int
    windows_px: tuple[int, ...]
    left_to_right_px: tuple[float, ...]
    right_to_left_px: tuple[float, ...]
    contrast: tuple[float, ...]


class HeadBag:
    """A bag with both eyes' pictures; a context manager.

    Args:
        path: folder of the bag, or its .mcap file.
        namespace: of the head in the bag; None for the only one that there is.

    Raises:
        BagError: no bag, or one without both eyes.
    """

    def __init__(self, path: str | Path, namespace: str | None = None) -> None:
        self.path = Path(path)
        if not self.path.exists():
            raise BagError(f"a recording must be a bag's folder or .mcap file: got '{path}', which does not exist")
        try:
            self._reader = AnyReader([self.path], default_typestore=get_typestore(Stores.ROS2_JAZZY))
            self._reader.open()
        except (AnyReaderError, OSError, ValueError) as error:
            raise BagError(f"the recording '{path}' cannot be read: {error}") from error
        self._open = True
        try:
            self._topics = {connection.topic for connection in self._reader.connections}
            self._prefix = self._found_prefix(namespace)
            self._pictures = {self._picture_topic(name): side for side, name in ((LEFT, "left"), (RIGHT, "right"))}
        except BaseException:
            self.close()
            raise

    @property
    def begin_ns(self) -> int:
        """Arrival of the first message."""
        return int(self._reader.start_time)

    @property
    def counts(self) -> dict[str, int]:
        """Number of messages by topic, relative to the head's namespace."""
        return {
            topic.removeprefix(self._prefix): info.msgcount
            for topic, info in self._reader.topics.items()
            if topic.startswith(self._prefix)
        }

    def cameras(self) -> tuple[CameraModel | None, CameraModel | None]:
        """Return the calibrated cameras, left and right; None for one that is not calibrated."""
        left, right = (self._camera(f"{self._prefix}{name}/camera_info") for name in SIDES)
        return left, right

    def events(self) -> Iterator[tuple[int, Picture | JointAngles | TrackRequest]]:
        """Yield pictures, joint angles and requests to the tracker, in pixels as taken, in order of arrival [ns].

        Pictures are decoded one by one; those that cannot be, and joint states without all three joints, are left out.
        """
        joints, requests = f"{self._prefix}joint_states", f"{self._prefix}vergence/track_request"
        for arrival_ns, topic, message in self._messages({*self._pictures, joints, requests}):
            if topic == requests:
                yield arrival_ns, _track_request(message)
                continue
            if topic == joints:
                angles = _joint_angles(message)
                if angles is not None:
                    yield arrival_ns, angles
            else:
                pixels = _pixels(message)
                if pixels is not None:
                    yield arrival_ns, Picture(self._pictures[topic], _stamp_ns(message.header), pixels)

    def metric(self) -> dict[int, RecordedMetric]:
        """Return what the head published as vergence/edge, by the stamp of the left picture [ns]; {} if nothing."""
        found = {}
        for _, _, message in self._messages({f"{self._prefix}vergence/edge"}):
            stamp_ns = _stamp_ns(message.header)
            values = (message.left_to_right_px, message.right_to_left_px, message.contrast)
            windows_px = tuple(int(size) for size in message.windows_px)
            found[stamp_ns] = RecordedMetric(stamp_ns, windows_px, *(tuple(map(float, one)) for one in values))
        return found

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """Yield the messages of a topic, relative to the head's namespace, with their arrival [ns]."""
        for arrival_ns, _, message in self._messages({f"{self._prefix}{topic}"}):
            yield arrival_ns, message

    def close(self) -> None:
        """Close the bag; idempotent."""
        if self._open:
            self._open = False
            self._reader.close()

    def __enter__(self) -> "HeadBag":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _messages(self, topics: set[str]) -> Iterator[tuple[int, str, Any]]:
        connections = [connection for connection in self._reader.connections if connection.topic in topics]
        if not connections:
            return
        for connection, arrival_ns, data in self._reader.messages(connections):
            yield arrival_ns, connection.topic, self._reader.deserialize(data, connection.msgtype)

    def _found_prefix(self, namespace: str | None) -> str:
        ends = tuple(f"left/image_raw{ending}" for ending in ("/compressed", ""))
        found = {topic.removesuffix(end) for topic in self._topics for end in ends if topic.endswith(f"/{end}")}
        if namespace is not None:
            prefix = f"/{namespace.strip('/')}/".replace("//", "/")
            found &= {prefix}
        if len(found) != 1:
            topics = ", ".join(sorted(found or self._topics)) or "none"
            must = "have the pictures of one head" if not found else "be asked for the namespace of one of its heads"
            raise BagError(f"the recording '{self.path}' must {must}: it has {topics}")
        return found.pop()

    def _picture_topic(self, side: str) -> str:
        for ending in ("image_raw/compressed", "image_raw"):
            topic = f"{self._prefix}{side}/{ending}"
            if topic in self._topics:
                return topic
        raise BagError(f"the recording '{self.path}' must have {self._prefix}{side}/image_raw/compressed: it has not")

    def _camera(self, topic: str) -> CameraModel | None:
        for _, _, message in self._messages({topic}):
            try:
                return CameraModel.from_camera_info_values(
                    message.width, message.height, message.k, message.d, message.distortion_model
                )
            except CameraModelError:
                return None
        return None


def _stamp_ns(header: Any) -> int:
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def _joint_angles(message: Any) -> JointAngles | None:
    found = dict(zip(message.name, message.position, strict=False))
    angles = np.array([float(found.get(name, np.nan)) for name in JOINT_NAMES])
    return JointAngles(_stamp_ns(message.header), angles) if np.isfinite(angles).all() else None


def _track_request(message: Any) -> TrackRequest:
    sized = message.width_px > 0.0 and message.height_px > 0.0
    return TrackRequest(
        goal_id=int(message.goal_id),
        stamp_s=_stamp_ns(message.header) * 1e-9,
        left_eye=message.eye == message.EYE_LEFT,
        pixel=(float(message.x_px), float(message.y_px)),
        extent_px=(float(message.width_px), float(message.height_px)) if sized else None,
        motion=bool(getattr(message, "motion", False)),  # recordings of before have no such field
    )


def _pixels(message: Any) -> Pixels | None:
    if not hasattr(message, "encoding"):
        try:
            return decode_picture(message.data)
        except FileError:
            return None
    channels, conversion = _CHANNELS.get(message.encoding, (0, None))
    rows = np.asarray(message.data, np.uint8)
    if not channels or rows.size < message.height * message.step or message.step < channels * message.width:
        return None
    rows = rows[: message.height * message.step].reshape(message.height, message.step)
    pixels = rows[:, : channels * message.width].reshape(message.height, message.width, channels)
    if channels == 1:
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels[:, :, 0]), cv2.COLOR_GRAY2BGR), np.uint8)
    return np.ascontiguousarray(pixels) if conversion is None else np.asarray(cv2.cvtColor(pixels, conversion))
