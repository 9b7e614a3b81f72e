"""The one way to decode a picture, of a file or a message: its claimed size is checked before memory is allocated.

Needs OpenCV (python3-opencv), which packages that read pictures depend on themselves.
"""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vergence_rig.picture_size import KINDS, picture_size
from vergence_rig.printed import printed_line
from vergence_rig.regular_file import FileError, read_regular_file

LARGEST_PIXELS = 64_000_000
"""Largest picture that is decoded [px]."""

_HEADER_BYTES = 65536

Pixels = npt.NDArray[np.uint8]


def read_picture(path: str | Path, flags: int = cv2.IMREAD_COLOR) -> Pixels:
    """Return a picture file as uint8, (h, w, 3) BGR or (h, w) as `flags` of OpenCV ask; see `decode_picture`."""
    return decode_picture(read_regular_file(path), flags)


def decode_picture(data: bytes | memoryview | npt.NDArray[np.uint8], flags: int = cv2.IMREAD_COLOR) -> Pixels:
    """Return an encoded picture as uint8, (h, w, 3) BGR or (h, w).

    A JPEG's EXIF orientation is applied unless `flags` have IMREAD_IGNORE_ORIENTATION: a picture file is shown as every
    viewer shows it, a camera's frames are as its calibration is.

    Raises FileError where it is none of the known kinds, has too many pixels, or cannot be decoded.
    """
    raw = np.frombuffer(data, np.uint8)
    size = picture_size(raw.tobytes() if len(raw) < _HEADER_BYTES else raw[:_HEADER_BYTES].tobytes())
    if size is None and len(raw) > _HEADER_BYTES:  # a TIFF may have its directory at its end, a JPEG long metadata
        size = picture_size(raw.tobytes())
    if size is None:
        raise FileError(f"is not a picture that OpenCV can decode: it must be a complete {KINDS} ({len(raw)} bytes)")
    width, height = size
    check_size(width, height)
    try:
        pixels = cv2.imdecode(raw, flags)
    except cv2.error as error:
        reason = printed_line(getattr(error, "err", "") or error)
        raise FileError(f"is a picture of {width}x{height} px that cannot be decoded: {reason}") from error
    if pixels is None:
        raise FileError(f"is a picture of {width}x{height} px that cannot be decoded ({len(raw)} bytes)")
    return np.asarray(pixels, np.uint8)


def check_size(width_px: int, height_px: int) -> None:
    """Raise FileError for a picture without pixels or with more than LARGEST_PIXELS."""
    if not 0 < width_px * height_px <= LARGEST_PIXELS:
        most = LARGEST_PIXELS // 1_000_000
        raise FileError(f"is too large a picture: it must have 1 to {most} million px: got {width_px}x{height_px} px")
