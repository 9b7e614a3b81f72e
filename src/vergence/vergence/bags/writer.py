"""Writes bags that `ros2 bag play`, Foxglove and `vergence replay` read: MCAP, definitions of all messages included."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

_NONE: Mapping[str, str] = MappingProxyType({})
_FOREVER = QosTime(sec=9223372036, nsec=854775807)


class BagError(ValueError):
    """A recording that cannot be written or read."""


class BagWriter:
    """A new bag; a context manager, and for one thread.

    Args:
        path: folder of the bag, which must not exist.
        definitions: texts of message definitions (.msg files) by type, of types that ROS itself has not.
    """

    def __init__(self, path: str | Path, definitions: Mapping[str, str] = _NONE) -> None:
        if Path(path).exists():
            raise BagError(f"the folder of a new recording must not exist: got '{path}'")
        self._types = get_typestore(Stores.ROS2_JAZZY)
        for name, text in definitions.items():
            self._types.register(get_types_from_msg(text, name))
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        try:
            self._writer.open()
        except OSError as error:
            raise BagError(f"the recording '{path}' cannot be written: {error}") from error
        self._connections: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        """Messages so far, by topic."""

    def types(self) -> Mapping[str, type]:
        """Return the classes of messages by type, to make messages for `write`."""
        return self._types.types

    def add(self, topic: str, kind: str, latched: bool = False) -> None:
        """Add a topic, before its first message."""
        profiles = [_qos(latched)]
        connection = self._writer.add_connection(topic, kind, typestore=self._types, offered_qos_profiles=profiles)
        self._connections[topic], self.counts[topic] = connection, 0

    def write(self, topic: str, time_ns: int, message: Any) -> None:
        """Write a message of a class of `types`; `time_ns` is when it arrived."""
        kind = self._connections[topic].msgtype
        self.write_cdr(topic, time_ns, self._types.serialize_cdr(message, kind))

    def write_cdr(self, topic: str, time_ns: int, data: bytes | memoryview) -> None:
        """Write a message as it came from the wire."""
        try:
            self._writer.write(self._connections[topic], time_ns, data)
        except OSError as error:
            raise BagError(f"the recording '{self._writer.path}' cannot be written: {error}") from error
        self.counts[topic] += 1

    def close(self) -> None:
        """Finish the bag; idempotent."""
        if self._writer.storage is not None:
            self._writer.close()

    def __enter__(self) -> "BagWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _qos(latched: bool) -> Qos:
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1 if latched else 10,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        deadline=_FOREVER,
        lifespan=_FOREVER,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=_FOREVER,
        avoid_ros_namespace_conventions=False,
    )
