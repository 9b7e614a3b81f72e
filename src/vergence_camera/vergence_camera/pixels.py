"""Decodes a frame to pixels, and encodes pixels as JPEG."""

import cv2
import numpy as np

from vergence_camera.errors import CorruptFrameError
from vergence_camera.frame import Encoding, Frame, Pixels
from vergence_rig.picture_file import decode_picture
from vergence_rig.regular_file import FileError


def decode(frame: Frame) -> tuple[Pixels, str]:
    """Return uint8 pixels and their ROS encoding: (h, w, 3) with "bgr8", or (h, w) with "mono8".

    Raises:
        CorruptFrameError: JPEG data that cannot be decoded, or decodes to another size.
    """
    if isinstance(frame.data, np.ndarray):
        return frame.data, "mono8" if frame.data.ndim == 2 else "bgr8"
    raw = np.frombuffer(frame.data, dtype=np.uint8)
    if frame.encoding is Encoding.GREY:
        return raw.reshape(frame.height_px, frame.width_px), "mono8"
    if frame.encoding is Encoding.YUYV:
        packed = raw.reshape(frame.height_px, frame.width_px, 2)
        return np.asarray(cv2.cvtColor(packed, cv2.COLOR_YUV2BGR_YUYV)), "bgr8"
    try:
        pixels = decode_picture(raw, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    except FileError as error:
        raise CorruptFrameError(f"JPEG {error}") from error
    if pixels.shape[:2] != (frame.height_px, frame.width_px):
        raise CorruptFrameError(f"JPEG of {frame.width_px}x{frame.height_px} decodes to another size")
    return pixels, "bgr8"


def encode_jpeg(pixels: Pixels, quality: int) -> bytes:
    """Return pixels (h, w, 3) BGR or (h, w) grey as JPEG of `quality` 1 to 100."""
    done, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise CorruptFrameError(f"pixels of {pixels.shape} cannot be encoded as JPEG")
    return bytes(data)
