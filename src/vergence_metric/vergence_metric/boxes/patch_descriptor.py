"""A small descriptor of what a box holds, by which one object's two views are recognised among others of its class."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box

_SIDE_PX = 16
_LEAST_CONTRAST = 4.0  # grey levels; below, noise would be scaled up

_PLACES_PX = np.array([(3.5, 4.0), (11.5, 4.0), (7.5, 8.0), (4.2, 12.0), (10.8, 12.0)])
"""Where a face's landmarks (FACE_LANDMARKS) are brought to."""

_MARGIN = 0.5  # of the landmarks' spread: what else the patch shows
_ANTIALIAS = 0.45

Descriptor = NDArray[np.float32]


def patch_descriptor(image: NDArray[Any], box: Box) -> Descriptor | None:
    """Return the box's content shrunk to 16x16, free of exposure and white balance: a unit vector (K,).

    Of a face with landmarks it is the content between them, brought to one place, turn and size. None where the box
    holds no pixels, or none that differ.

    Args:
        image: (h, w, 3) or (h, w) uint8.
        box: in its pixels.

    """
    small = _aligned(image, box) if box.landmarks_px else _shrunk(image, box)
    if small is None:
        return None
    planes = small.astype(np.float32).reshape(_SIDE_PX * _SIDE_PX, -1)
    planes = (planes - planes.mean(0)) / (planes.std(0) + _LEAST_CONTRAST)
    vector = planes.ravel()
    norm = float(np.linalg.norm(vector))
    return None if norm == 0.0 else np.asarray(vector / norm, np.float32)


def _shrunk(image: NDArray[Any], box: Box) -> NDArray[Any] | None:
    height, width = image.shape[:2]
    x_min, y_min, x_max, y_max = box.xyxy_px
    left, top = max(round(x_min + 0.5), 0), max(round(y_min + 0.5), 0)
    right, bottom = min(round(x_max + 0.5), width), min(round(y_max + 0.5), height)
    if right - left < 2 or bottom - top < 2:
        return None
    return np.asarray(cv2.resize(image[top:bottom, left:right], (_SIDE_PX, _SIDE_PX), interpolation=cv2.INTER_AREA))


def _aligned(image: NDArray[Any], box: Box) -> NDArray[Any] | None:
    """Return the face (16, 16) at the similarity that brings its landmarks nearest to _PLACES_PX."""
    points = np.array(box.landmarks_px)
    from_points, to_places = points - points.mean(0), _PLACES_PX - _PLACES_PX.mean(0)
    # As complex numbers a similarity is one factor (least squares).
    z, w = from_points @ [1.0, 1j], to_places @ [1.0, 1j]
    spread = float((np.abs(z) ** 2).sum())
    if not spread > 0.0:
        return None
    factor = (np.conj(z) @ w) / spread
    if not abs(factor) > 0.0:
        return None
    shrink = 1.0 / abs(factor)
    turn = np.array([[factor.real, -factor.imag], [factor.imag, factor.real]])
    low, high = points.min(0) - _MARGIN * np.sqrt(spread), points.max(0) + _MARGIN * np.sqrt(spread)
    first = np.maximum(np.floor(low).astype(int), 0)
    last = np.minimum(np.ceil(high).astype(int) + 1, image.shape[1::-1])
    if (last - first < 2).any():
        return None
    part = image[first[1] : last[1], first[0] : last[0]]
    if shrink > 1.3:
        part = np.asarray(cv2.GaussianBlur(part, (0, 0), _ANTIALIAS * shrink))
    shift = _PLACES_PX.mean(0) - turn @ (points.mean(0) - first)
    matrix = np.column_stack([turn, shift])
    return np.asarray(
        cv2.warpAffine(part, matrix, (_SIDE_PX, _SIDE_PX), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    )


def descriptor_correlation(a: Descriptor | None, b: Descriptor | None) -> float | None:
    """Return the correlation of two descriptors, -1 to 1; None where one is missing."""
    return None if a is None or b is None else float(a @ b)
