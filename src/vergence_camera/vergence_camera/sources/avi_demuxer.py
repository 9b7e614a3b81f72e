"""The JPEGs inside a Motion-JPEG AVI, untouched (RIFF AVI 1.0 and OpenDML files without end)."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import BinaryIO

from vergence_camera.errors import TruncatedFileError, UnsupportedError

_CHUNK = struct.Struct("<4sI")
_MJPEG_CODES = {b"MJPG", b"mjpg", b"JPEG", b"jpeg", b"AVRn", b"dmb1"}


@dataclass(frozen=True)
class AviHeader:
    """Video stream's number, four-character code, size, rate, and where the first RIFF's chunks begin and end."""

    stream: int
    code: bytes
    width_px: int
    height_px: int
    rate_hz: float

    @property
    def is_mjpeg(self) -> bool:
        """True if the frames are JPEGs."""
        return self.code in _MJPEG_CODES


def is_avi(path: Path) -> bool:
    """True if the file begins like an AVI."""
    with path.open("rb") as file:
        head = file.read(12)
    return head[:4] == b"RIFF" and head[8:] == b"AVI "


def read_header(file: BinaryIO | FileIO, name: str) -> AviHeader:
    """Return the description of the first video stream.

    Raises:
        UnsupportedError: no AVI, or none with video in it.
        TruncatedFileError: the file ends inside its header.
    """
    size = _size_of(file)
    file.seek(0)
    if file.read(4) != b"RIFF" or file.read(8)[4:] != b"AVI ":
        raise UnsupportedError(f"{name}: is not an AVI file")
    stream = -1
    wanted: tuple[int, bytes, float] | None = None
    for tag, begin, length in _walk(file, 12, size, enter=(b"hdrl", b"strl")):
        if begin + length > size:
            raise TruncatedFileError(f"{name}: the file ends inside its header")
        if tag == b"strh":
            stream += 1
            header = _read_at(file, begin, min(length, 36))
            if header[:4] == b"vids" and wanted is None:
                scale, rate = struct.unpack_from("<II", header, 20)
                wanted = (stream, header[4:8], rate / scale if scale else 0.0)
        elif tag == b"strf" and wanted is not None and stream == wanted[0]:
            width, height = struct.unpack_from("<ii", _read_at(file, begin, 40), 4)
            code = _read_at(file, begin + 16, 4)
            known = wanted[1] if wanted[1].strip(b"\0 ") else code
            return AviHeader(stream, code if code in _MJPEG_CODES else known, width, abs(height), wanted[2])
        elif tag == b"movi":
            break
    raise UnsupportedError(f"{name}: the AVI file has no video stream")


def frames(file: BinaryIO | FileIO, header: AviHeader, name: str) -> Iterator[bytes]:
    """Yield the video stream's chunks in order of the file; empty ones repeat the last frame and are left out.

    Raises:
        TruncatedFileError: the file ends in the middle of a frame, after all whole ones were yielded.
    """
    size = _size_of(file)
    wanted = (b"%02ddc" % header.stream, b"%02ddb" % header.stream)
    position = 0
    while position + 12 <= size:
        if _read_at(file, position, 4) != b"RIFF":
            return
        end = position + 8 + struct.unpack("<I", _read_at(file, position + 4, 4))[0]
        for tag, begin, length in _walk(file, position + 12, min(end, size), enter=(b"movi", b"rec ")):
            if tag not in wanted:
                continue
            if begin + length > size:
                raise TruncatedFileError(f"{name}: the file ends {begin + length - size} bytes before its last frame")
            if length:
                yield file.read(length)
        if end > size:
            raise TruncatedFileError(f"{name}: the file has {size} bytes, its header says {end}")
        position = end + (end & 1)


def _walk(
    file: BinaryIO | FileIO, position: int, end: int, enter: tuple[bytes, ...]
) -> Iterator[tuple[bytes, int, int]]:
    """Yield tag, begin and length of each chunk, with the file standing at its begin.

    A list is yielded by its type; those in `enter` are then entered, which is no more than to step over their head.
    """
    while position + 8 <= end:
        file.seek(position)
        tag, length = _CHUNK.unpack(file.read(8))
        begin = position + 8
        position = begin + length + (length & 1)
        if tag == b"LIST":
            tag, begin, length = file.read(4), begin + 4, max(0, length - 4)
            if tag in enter:
                position = begin
        yield tag, begin, length


def _read_at(file: BinaryIO | FileIO, position: int, length: int) -> bytes:
    file.seek(position)
    return file.read(length)


def _size_of(file: BinaryIO | FileIO) -> int:
    return file.seek(0, 2)
