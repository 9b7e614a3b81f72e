"""Images at a smaller scale."""

import cv2
import numpy as np

from vergence_metric.disparity.protocol import Image


def reduced(image: Image, scale: int) -> Image:
    """Return the image (h, w) with the mean of every `scale` by `scale` pixels as one."""
    if scale == 1:
        return image
    height, width = image.shape
    size = (width // scale, height // scale)
    return np.asarray(cv2.resize(image[: size[1] * scale, : size[0] * scale], size, interpolation=cv2.INTER_AREA))
