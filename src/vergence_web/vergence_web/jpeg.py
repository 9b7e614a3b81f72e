"""Pixels to JPEG, for images that do not come as JPEG."""

import cv2
import numpy as np
import numpy.typing as npt


def jpeg_of(pixels: npt.NDArray[np.uint8], quality: int) -> bytes:
    """Return BGR (h, w, 3) or grey (h, w) pixels as JPEG; quality 1 to 100. Raises ValueError where it cannot be."""
    done, encoded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not done:
        raise ValueError(f"pixels of {pixels.shape} {pixels.dtype} cannot be encoded as JPEG")
    return bytes(encoded.tobytes())
