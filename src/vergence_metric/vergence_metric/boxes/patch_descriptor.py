"""A small descriptor of what a box holds, by which one object's two views are recognised among others of its class."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box

_SIDE_PX = 16
_LEAST_CONTRAST = 4.0  # grey levels; below, noise would be scaled up

Descriptor = NDArray[np.float32]


def patch_descriptor(image: NDArray[Any], box: Box) -> Descriptor | None:
    """Return the box's content shrunk to 16x16, free of exposure and white balance: a unit vector (K,).

    None where the box holds no pixels, or none that differ.

    Args:
        image: (h, w, 3) or (h, w) uint8.
        box: in its pixels.

    """
    height, width = image.shape[:2]
    x_min, y_min, x_max, y_max = box.xyxy_px
    left, top = max(round(x_min + 0.5), 0), max(round(y_min + 0.5), 0)
    right, bottom = min(round(x_max + 0.5), width), min(round(y_max + 0.5), height)
    if right - left < 2 or bottom - top < 2:
        return None
    small = cv2.resize(image[top:bottom, left:right], (_SIDE_PX, _SIDE_PX), interpolation=cv2.INTER_AREA)
    planes = small.astype(np.float32).reshape(_SIDE_PX * _SIDE_PX, -1)
    planes = (planes - planes.mean(0)) / (planes.std(0) + _LEAST_CONTRAST)
    vector = planes.ravel()
    norm = float(np.linalg.norm(vector))
    return None if norm == 0.0 else np.asarray(vector / norm, np.float32)


def descriptor_correlation(a: Descriptor | None, b: Descriptor | None) -> float | None:
    """Return the correlation of two descriptors, -1 to 1; None where one is missing."""
    return None if a is None or b is None else float(a @ b)
