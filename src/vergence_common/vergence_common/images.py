"""Image messages to numpy arrays and back, with checks of every field of a message.

This is the only module of the package that needs OpenCV (python3-opencv): packages that use images depend on it
themselves, so that a machine which only drives servos need not install it.
"""

import array
import sys

import cv2
import numpy as np
import numpy.typing as npt
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from vergence_rig.picture_file import decode_picture
from vergence_rig.regular_file import FileError

Array = npt.NDArray[np.uint8]

_AS_SENT = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
_CHANNELS = {"bgr8": 3, "rgb8": 3, "mono8": 1}


class ImageError(ValueError):
    """An invalid image message: the error names the field, what it must be, and its value."""


def image_to_array(message: Image) -> Array:
    """Return the pixels of an image message.

    Args:
        message: encoding bgr8, rgb8 or mono8; rows may be padded (`step`).

    Returns:
        uint8, (h, w, 3) BGR for a colour encoding, (h, w) for mono8. For bgr8 and mono8 it is a view of the message's
        own data, which must not be written to; rgb8 is converted.

    Raises:
        ImageError: another encoding, an empty image, or a wrong step or length.
    """
    channels = _CHANNELS.get(message.encoding)
    if channels is None:
        raise ImageError(f"encoding must be one of {', '.join(map(repr, _CHANNELS))}: got {message.encoding!r}")
    height, width, step = message.height, message.width, message.step
    if height == 0 or width == 0:
        raise ImageError(f"size must be at least 1x1: got {width}x{height}")
    if step < width * channels:
        raise ImageError(f"step must be at least {width * channels} ({width} px of {channels} bytes): got {step}")
    if len(message.data) != step * height:
        raise ImageError(f"data must have {step * height} bytes ({height} rows of {step}): got {len(message.data)}")
    rows: Array = np.frombuffer(message.data, dtype=np.uint8).reshape(height, step)
    if channels == 1:
        return rows[:, :width]
    pixels = rows[:, : width * 3].reshape(height, width, 3) if step == width * 3 else _strided(rows, width)
    if message.encoding == "rgb8":
        return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR))
    return pixels


def _strided(rows: Array, width: int) -> Array:
    return np.lib.stride_tricks.as_strided(rows, (rows.shape[0], width, 3), (rows.strides[0], 3, 1), writeable=False)


def array_to_image(pixels: Array, header: Header, encoding: str = "bgr8") -> Image:
    """Return an image message with a copy of the pixels.

    Args:
        pixels: uint8, (h, w, 3) for bgr8 and rgb8, (h, w) for mono8.
        header: the message's header.
        encoding: how the pixels are ordered; nothing is converted.

    Raises:
        ImageError: pixels that do not have the encoding's shape or type.
    """
    channels = _CHANNELS.get(encoding)
    expected = (2,) if channels == 1 else (3,)
    if channels is None or pixels.dtype != np.uint8 or (pixels.ndim,) != expected or pixels.shape[2:] not in ((), (3,)):
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
