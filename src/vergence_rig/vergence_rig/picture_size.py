"""The size that a picture file claims, from its header alone: before memory for its pixels is allocated.

PNG (ISO 15948), JPEG (ITU-T T.81), BMP, TIFF 6.0, WebP (RFC 9649), PBM, PGM and PPM.
"""

import re
import struct
from collections.abc import Callable

KINDS = "PNG, JPEG, BMP, TIFF, WebP, PBM, PGM or PPM"

_JPEG_SIZE = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_JPEG_ALONE = frozenset((0x01, *range(0xD0, 0xD8)))
_PNM = re.compile(rb"P[1-6](?:\s|#[^\n\r]*[\n\r])+(\d+)(?:\s|#[^\n\r]*[\n\r])+(\d+)\s")
_TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_SHORT = 256, 257, 3

Size = tuple[int, int]


def picture_size(data: bytes) -> Size | None:
    """Return (width, height) [px] from the header of an encoded picture; None if it is none of KINDS, or damaged."""
    reader = next((reader for begins, reader in _READERS if any(data.startswith(magic) for magic in begins)), None)
    try:
        return reader(data) if reader is not None else None
    except (struct.error, IndexError):  # cut short
        return None


def _png(data: bytes) -> Size | None:
    return struct.unpack_from(">II", data, 16) if data[12:16] == b"IHDR" else None


def _jpeg(data: bytes) -> Size | None:
    position = 2
    while data[position] == 0xFF:
        code = data[position + 1]
        if code == 0xFF or code in _JPEG_ALONE:
            position += 1 if code == 0xFF else 2
            continue
        if code in _JPEG_SIZE:
            height, width = struct.unpack_from(">HH", data, position + 5)
            return width, height
        position += 2 + struct.unpack_from(">H", data, position + 2)[0]
    return None


def _bmp(data: bytes) -> Size | None:
    if struct.unpack_from("<I", data, 14)[0] == 12:
        return struct.unpack_from("<HH", data, 18)
    width, height = struct.unpack_from("<ii", data, 18)
    return abs(width), abs(height)


def _tiff(data: bytes) -> Size | None:
    order = "<" if data[:2] == b"II" else ">"
    begin = struct.unpack_from(f"{order}I", data, 4)[0]
    sizes = {}
    for entry in range(struct.unpack_from(f"{order}H", data, begin)[0]):
        at = begin + 2 + 12 * entry
        tag, kind = struct.unpack_from(f"{order}HH", data, at)
        if tag in (_TIFF_WIDTH, _TIFF_HEIGHT):
            sizes[tag] = struct.unpack_from(f"{order}{'H' if kind == _TIFF_SHORT else 'I'}", data, at + 8)[0]
    return (sizes[_TIFF_WIDTH], sizes[_TIFF_HEIGHT]) if len(sizes) == 2 else None


def _webp(data: bytes) -> Size | None:
    kind = data[12:16]
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", data, 26)
        return width & 0x3FFF, height & 0x3FFF
    if kind == b"VP8L":
        bits = struct.unpack_from("<I", data, 21)[0]
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8X" and len(data) >= 30:
        return int.from_bytes(data[24:27], "little") + 1, int.from_bytes(data[27:30], "little") + 1
    return None


def _pnm(data: bytes) -> Size | None:
    found = _PNM.match(data[:4096])
    # Python reads no whole number of more than 4300 digits; the header that is looked at is shorter.
    return (int(found[1]), int(found[2])) if found else None


_READERS: tuple[tuple[tuple[bytes, ...], Callable[[bytes], Size | None]], ...] = (
    ((b"\x89PNG\r\n\x1a\n",), _png),
    ((b"\xff\xd8",), _jpeg),
    ((b"BM",), _bmp),
    ((b"II*\0", b"MM\0*"), _tiff),
    ((b"RIFF",), _webp),
    (tuple(b"P%d" % kind for kind in range(1, 7)), _pnm),
)
