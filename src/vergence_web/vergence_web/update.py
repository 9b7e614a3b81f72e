"""What is sent to a page: the newest of each part, in one binary message."""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

HEADER = struct.Struct("<I")


@dataclass(frozen=True)
class Part:
    """One part of an update.

    Attributes:
        text: values as JSON, of a state.
        data: bytes, of an image (JPEG).
        about: values that belong to the bytes, such as the stamp.
    """

    text: str = ""
    data: bytes = b""
    about: Mapping[str, Any] = field(default_factory=dict)


def encode(number: int, parts: Mapping[str, Part]) -> bytes:
    """Return an update as it is sent: the length of a JSON header (uint32, little endian), the header, the images.

    The header has the update's `number`, the states by name, and in `images` the name, size in bytes and values of each
    image, in the order of their bytes.
    """
    images = {name: part for name, part in parts.items() if part.data}
    fields = [f'"number":{number}']
    fields += [f"{json.dumps(name)}:{part.text}" for name, part in parts.items() if not part.data]
    listed = [{"name": name, "bytes": len(part.data), **part.about} for name, part in images.items()]
    fields.append(f'"images":{json.dumps(listed)}')
    header = ("{" + ",".join(fields) + "}").encode()
    return b"".join([HEADER.pack(len(header)), header, *(part.data for part in images.values())])


class Board:
    """The newest of each part, with a version that says whether a page has it already."""

    def __init__(self) -> None:
        self._parts: dict[str, tuple[int, Part]] = {}
        self._version = 0

    def post(self, parts: Mapping[str, Part]) -> None:
        """Replace parts by newer ones."""
        self._version += 1
        self._parts.update((name, (self._version, part)) for name, part in parts.items())

    def clear(self) -> None:
        """Forget every part: a page that comes later must not show what is old."""
        self._parts.clear()

    def newer_than(self, version: int) -> tuple[int, dict[str, Part]]:
        """Return the present version, and the parts that are newer than one."""
        return self._version, {name: part for name, (at, part) in self._parts.items() if at > version}
