"""Image messages to numpy arrays and back, with checks of every field of a message.

With `encodings` this is the only module of the package that needs OpenCV (python3-opencv): packages that use images
depend on it themselves, so that a machine which only drives servos need not install it.
"""

import array
import sys

import cv2
import numpy as np
import numpy.typing as npt
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from vergence_common.encodings import ENCODINGS, PUBLISHED, ImageEncoding
from vergence_rig.picture_file import decode_picture
from vergence_rig.regular_file import FileError

Array = npt.NDArray[np.uint8]

_AS_SENT = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
_LONGEST_SHOWN = 40


class ImageError(ValueError):
    """An invalid image message: the error names the field, what it must be, and its value."""


def image_to_array(message: Image) -> Array:
    """Return the pixels of an image message.

    Args:
        message: in any of ENCODINGS; rows may be padded (`step`).

    Returns:
        uint8, (h, w, 3) BGR for a colour encoding, (h, w) for a grey one. For those of eight bits that need no
        conversion it is a view of the message's own data, which must not be written to.

    Raises:
        ImageError: another encoding, an empty image, or a wrong step or length.
    """
    encoding = ENCODINGS.get(message.encoding)
    if encoding is None:
        got = message.encoding[:_LONGEST_SHOWN]
        raise ImageError(f"encoding must be one of {', '.join(map(repr, ENCODINGS))}: got {got!r}")
    rows = _rows(message, encoding)
    width, channels = message.width, encoding.channels
    if encoding.bits == 16:
        # Of each number the upper byte: the second one in little endian.
        rows = rows[:, 0 if message.is_bigendian else 1 :: 2]
    if channels == 1:
        pixels = rows[:, :width]
    elif rows.strides == (width * channels, 1):
        pixels = rows.reshape(rows.shape[0], width, channels)
    else:
        pixels = _strided(rows, width, channels)
    if encoding.conversion is None:
        return pixels
    try:
        return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), encoding.conversion))
    except cv2.error as error:
        size = f"{width}x{message.height}"
        raise ImageError(f"an image of {size} px cannot be converted from {message.encoding!r}") from error


def _rows(message: Image, encoding: ImageEncoding) -> Array:
    """Return the message's bytes as rows, (n, step) uint8; raises ImageError where its fields do not fit."""
    height, width, step = message.height, message.width, message.step
    pixel_bytes = encoding.channels * encoding.bits // 8
    if height == 0 or width == 0:
        raise ImageError(f"size must be at least 1x1: got {width}x{height}")
    if encoding.even and (width % 2 or (encoding.rows_per_two != 2 and height % 2)):
        raise ImageError(f"sides must be even for {message.encoding!r}: got {width}x{height}")
    if step < width * pixel_bytes:
        raise ImageError(f"step must be at least {width * pixel_bytes} ({width} px of {pixel_bytes} bytes): got {step}")
    count = height * encoding.rows_per_two // 2
    if len(message.data) != step * count:
        raise ImageError(f"data must have {step * count} bytes ({count} rows of {step}): got {len(message.data)}")
    rows: Array = np.frombuffer(message.data, dtype=np.uint8).reshape(count, step)
    return rows if encoding.bits == 8 or step % 2 == 0 else rows[:, : width * pixel_bytes]


def _strided(rows: Array, width: int, channels: int) -> Array:
    """Return rows of bytes as pixels (n, width, channels), a view."""
    across = rows.strides[1]
    shape, strides = (rows.shape[0], width, channels), (rows.strides[0], across * channels, across)
    return np.lib.stride_tricks.as_strided(rows, shape, strides, writeable=False)


def array_to_image(pixels: Array, header: Header, encoding: str = "bgr8") -> Image:
    """Return an image message with a copy of the pixels.

    Args:
        pixels: uint8, (h, w, 3) for bgr8 and rgb8, (h, w) for mono8.
        header: the message's header.
        encoding: how the pixels are ordered; nothing is converted.

    Raises:
        ImageError: pixels that do not have the encoding's shape or type.
    """
    channels = ENCODINGS[encoding].channels if encoding in PUBLISHED else 0
    expected = (2,) if channels == 1 else (3,)
    if not channels or pixels.dtype != np.uint8 or (pixels.ndim,) != expected or pixels.shape[2:] not in ((), (3,)):
        raise ImageError(
            f"pixels must be uint8 of the shape of encoding {encoding!r}: got {pixels.dtype} {pixels.shape}"
        )
    message = Image(header=header, height=pixels.shape[0], width=pixels.shape[1], encoding=encoding)
    message.step = pixels.shape[1] * channels
    message.is_bigendian = int(sys.byteorder == "big")
    # An array('B') is taken as it is; bytes and lists would be checked and copied element by element.
    data = array.array("B")
    data.frombytes(np.ascontiguousarray(pixels).data.cast("B"))
    message.data = data
    return message


def compressed_to_array(message: CompressedImage) -> Array:
    """Return the pixels of a JPEG or PNG message: uint8 (h, w, 3) BGR. Raises ImageError where it cannot be decoded."""
    try:
        return decode_picture(np.frombuffer(message.data, dtype=np.uint8), _AS_SENT)
    except FileError as error:
        raise ImageError(f"compressed data {error}, format {message.format!r}") from error


def array_to_compressed(pixels: Array, header: Header, quality: int = 90) -> CompressedImage:
    """Return a JPEG message of BGR pixels (h, w, 3); quality 1 to 100. Raises ImageError where it cannot be encoded."""
    done, encoded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ImageError(f"pixels of {pixels.shape} {pixels.dtype} cannot be encoded as JPEG")
    return jpeg_to_compressed(encoded.tobytes(), header)


def jpeg_to_compressed(jpeg: bytes, header: Header) -> CompressedImage:
    """Return a message that carries JPEG bytes untouched."""
    message = CompressedImage(header=header, format="bgr8; jpeg compressed bgr8")
    message.data = array.array("B", jpeg)
    return message
