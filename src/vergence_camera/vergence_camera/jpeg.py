"""Look into a JPEG without decoding it: its size, and whether it is whole (ITU-T T.81, annex B)."""

import re
from dataclasses import dataclass

from vergence_camera.errors import CorruptFrameError

_START, _END = b"\xff\xd8", b"\xff\xd9"
_FRAME_HEADERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_START_OF_SCAN = 0xDA
# Inside entropy-coded data 0xFF is stuffed with 0x00; only restart markers may stand there.
_MARKER_IN_SCAN = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")
_last_header: tuple[bytes, tuple[int, int, int]] | None = None
_BETWEEN_SCANS = frozenset({0xC4, 0xDA, 0xDB, 0xDC, 0xDD, 0xFE})


@dataclass(frozen=True)
class JpegInfo:
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
    if data[:2] != _START:
        raise CorruptFrameError(f"frame of {len(data)} bytes does not begin like a JPEG (ff d8): {data[:4].hex(' ')}")
    known = _last_header
    if known is not None and data.startswith(known[0]):
        position, size = len(known[0]), known[1]
    else:
        position, size = _read_header(data)
    end = _end_of_scans(data, position)
    if end is None:
        if must_be_whole:
            raise CorruptFrameError(f"JPEG of {len(data)} bytes has no end marker or a foreign one in its data")
        end = len(data)
    return JpegInfo(*size, end)


def _read_header(data: bytes) -> tuple[int, tuple[int, int, int]]:
    """Return where the coded data begins, and width, height and components; remember them for the next frame.

    A camera's header is the same in every frame, so that it is parsed once.
    """
    global _last_header
    position, size = 2, None
    while True:
        code, payload, position = _segment(data, position)
        if code in _FRAME_HEADERS:
            if len(payload) < 6:
                raise CorruptFrameError("JPEG frame header is cut short")
            size = (payload[3] << 8 | payload[4], payload[1] << 8 | payload[2], payload[5])
        if code == _START_OF_SCAN:
            break
    if size is None or 0 in size:
        raise CorruptFrameError("JPEG has no size before its first scan")
    _last_header = (data[:position], size)
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


def _end_of_scans(data: bytes, position: int) -> int | None:
    while (found := _MARKER_IN_SCAN.search(data, position)) is not None:
        code = data[found.start() + 1]
        if code == _END[1]:
            return found.end()
        if code not in _BETWEEN_SCANS:
            return None
        try:
            position = _segment(data, found.start())[2]
        except CorruptFrameError:
            return None
    return None
