"""The EXIF orientation of a JPEG (CIPA DC-008, tag 274)."""

import struct

_ORIENTATION = 274
_UPRIGHT = 1


def is_turned(jpeg: bytes) -> bool:
    """Return whether a JPEG asks to be shown turned or mirrored."""
    return _orientation(jpeg) not in (0, _UPRIGHT)


def _orientation(jpeg: bytes) -> int:
    """Return 1 to 8, 0 where nothing is said."""
    try:
        position = 2
        while jpeg[position] == 0xFF and jpeg[position + 1] not in (0xDA, 0xD9):
            length = struct.unpack_from(">H", jpeg, position + 2)[0]
            if jpeg[position + 1] == 0xE1 and jpeg[position + 4 : position + 10] == b"Exif\0\0":
                return _of_directory(jpeg[position + 10 : position + 2 + length])
            position += 2 + length
    except (struct.error, IndexError):
        return 0
    return 0


def _of_directory(tiff: bytes) -> int:
    order = "<" if tiff[:2] == b"II" else ">"
    begin = struct.unpack_from(f"{order}I", tiff, 4)[0]
    for entry in range(struct.unpack_from(f"{order}H", tiff, begin)[0]):
        at = begin + 2 + 12 * entry
        if struct.unpack_from(f"{order}H", tiff, at)[0] == _ORIENTATION:
            value = int(struct.unpack_from(f"{order}H", tiff, at + 8)[0])
            return value if 1 <= value <= 8 else 0
    return 0
