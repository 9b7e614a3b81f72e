"""How alike two boxes' contents look: it tells one object's two views from another object of its class."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box

_SIDE_PX = 16


def signature(image: NDArray[Any], box: Box) -> NDArray[np.float32] | None:
    """Return what the box holds, small and free of exposure and white balance: unit vector (K,); None if nothing.

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
    planes = (planes - planes.mean(0)) / (planes.std(0) + 4.0)
    vector = planes.ravel()
    norm = float(np.linalg.norm(vector))
    return None if norm == 0.0 else np.asarray(vector / norm, np.float32)


def likeness(a: NDArray[np.float32] | None, b: NDArray[np.float32] | None) -> float | None:
    """Return the correlation of two signatures, -1 to 1; None where one is missing."""
    return None if a is None or b is None else float(a @ b)
