"""Images at a smaller scale, as they are and as their places are compared."""

import cv2
import numpy as np

from vergence_metric.disparity.protocol import Image

_ABOUT = (15, 15)  # within which the contrast is made even [px of the reduced image]
_MIDDLE, _DEVIATION = 128.0, 48.0  # of a levelled image [grey levels]
_NOISE_VARIANCE = 6.0  # [grey levels^2]: what varies less is not raised


def reduced(image: Image, scale: int) -> Image:
    """Return the image (h, w) with the mean of every `scale` by `scale` pixels as one."""
    if scale == 1:
        return image
    height, width = image.shape
    size = (width // scale, height // scale)
    return np.asarray(cv2.resize(image[: size[1] * scale, : size[0] * scale], size, interpolation=cv2.INTER_AREA))


def levelled(image: Image, scale: int) -> Image:
    """Return an image (h, w) that was reduced by a scale with every part at the same contrast; at scale 1 as it is.

    What is dim counts as much as what is bright then: along a bright pole a place is known by the dark room beside it.
    """
    if scale == 1:
        return image
    values = image.astype(np.float32)
    mean = cv2.blur(values, _ABOUT)
    variance = np.maximum(cv2.blur(values * values, _ABOUT) - mean * mean, 0.0)
    even = _MIDDLE + _DEVIATION * (values - mean) / np.sqrt(variance + _NOISE_VARIANCE)
    return np.asarray(np.clip(even, 0.0, 255.0), np.uint8)
