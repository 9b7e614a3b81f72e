"""Look into a JPEG without decoding it: its size, and whether it is whole (ITU-T T.81, annex B)."""

import re
from typing import NamedTuple, TypeAlias

from vergence_camera.errors import CorruptFrameError

JPEG_START, _END = b"\xff\xd8", b"\xff\xd9"
_FRAME_HEADERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_START_OF_SCAN = 0xDA
# Inside entropy-coded data 0xFF is stuffed with 0x00; only restart markers may stand there.
_MARKER_IN_SCAN = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
_SCAN = b"\xff\xda"
_Header: TypeAlias = tuple[int, tuple[int, int, int]]
_headers_by_bytes: dict[bytes, _Header] = {}
_MOST_HEADS = 64
_BETWEEN_SCANS = frozenset({0xC4, 0xDA, 0xDB, 0xDC, 0xDD, 0xFE})


class JpegInfo(NamedTuple):
    """Size in pixels, number of colour components, and where the picture ends in the bytes."""

    width_px: int
    height_px: int
    components: int
    end: int


def inspect_jpeg(data: bytes, *, must_be_whole: bool = True) -> JpegInfo:
    """Return what the markers say.

    Cameras pad their buffers: whatever follows the end marker is not looked at. Bit errors inside the coded data that
    make no marker cannot be seen without decoding.

    Args:
        data: the bytes from one buffer, multipart part or AVI chunk.
        must_be_whole: False lets pass a picture that lacks its end marker, as a few cameras send it.

    Raises:
        CorruptFrameError: no picture, no size, or not whole.
    """
    if not data.startswith(JPEG_START):
        raise CorruptFrameError(f"frame of {len(data)} bytes does not begin like a JPEG (ff d8): {data[:4].hex(' ')}")
    head = data[: data.find(_SCAN, 2) + 4]
    cached = _headers_by_bytes.get(head)
    if cached is None or cached[0] > len(data):
        cached = _read_header(data, head)
    position, size = cached
    end = _end_of_scans(data, position)
    if end < 0:
        if must_be_whole:
            raise CorruptFrameError(f"JPEG of {len(data)} bytes has no end marker or a foreign one in its data")
        end = len(data)
    return JpegInfo(*size, end)


def _read_header(data: bytes, head: bytes) -> _Header:
    """Return where the coded data begins, and width, height and components.

    Cameras send few different headers, often one: they are cached by their bytes up to the scan's marker.
    """
    begin, size = 2, None
    while True:
        code, payload, position = _segment(data, begin)
        if code in _FRAME_HEADERS:
            if len(payload) < 6:
                raise CorruptFrameError("JPEG frame header is cut short")
            size = (payload[3] << 8 | payload[4], payload[1] << 8 | payload[2], payload[5])
        if code == _START_OF_SCAN:
            break
        begin = position
    if size is None or 0 in size:
        raise CorruptFrameError("JPEG has no size before its first scan")
    if begin + 4 == len(head):
        if len(_headers_by_bytes) >= _MOST_HEADS:
            _headers_by_bytes.clear()
        _headers_by_bytes[head] = (position, size)
    return position, size


def _segment(data: bytes, position: int) -> tuple[int, bytes, int]:
    """Return marker code, payload and the position behind the segment that begins at `position`."""
    while data[position : position + 2] == b"\xff\xff":
        position += 1
    head = data[position : position + 4]
    if len(head) < 4 or head[0] != 0xFF or head[1] in (0x00, 0xD8, 0xD9):
        raise CorruptFrameError(f"JPEG header is damaged at byte {position}: {head.hex(' ')}")
    end = position + 2 + (head[2] << 8 | head[3])
    if end > len(data) or end < position + 4:
        raise CorruptFrameError(f"JPEG header is cut short at byte {position}")
    return head[1], data[position + 4 : end], end


def _end_of_scans(data: bytes, position: int) -> int:
    """Return where the end marker ends, -1 if there is none or a foreign one before it."""
    while (found := _MARKER_IN_SCAN.search(data, position)) is not None:
        if found[0] == _END:
            return found.end()
        if found[0][1] not in _BETWEEN_SCANS:
            return -1
        try:
            position = _segment(data, found.start())[2]
        except CorruptFrameError:
            return -1
    return -1
