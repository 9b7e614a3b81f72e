"""The true box of a box-shaped object: its outline by projection, its visible part by segmentation."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

_CLEAR_SHARE = 0.97
_LEAST_AREA_PX = 12
_NEAREST_M = 0.02


@dataclass(frozen=True)
class Label:
    """A box xyxy counted from the first pixel's centre [px], the share of the outline that is seen, whether it is cut.

    What lies beyond the border counts as unseen.
    """

    box_px: list[float]
    share: float
    cut: bool


def label(local_m: NDArray[np.float64], seen: NDArray[np.bool_], focal_px: float) -> Label | None:
    """Return the label of an object, None out of view.

    The box is that of the geometric outline where nothing hides any of it, else of the pixels that are seen.

    Args:
        local_m: (8, 3) its corners in the camera's frame: x right, y up, z back.
        seen: (h, w) where the image shows it.
        focal_px: of the pinhole camera, whose axis meets the image's middle.

    """
    depth, middle = -local_m[:, 2], (0.5 * (seen.shape[1] - 1), 0.5 * (seen.shape[0] - 1))
    if (depth < _NEAREST_M).any():
        return None
    places = np.column_stack(
        [middle[0] + focal_px * local_m[:, 0] / depth, middle[1] - focal_px * local_m[:, 1] / depth]
    )
    outline, hull = np.zeros(seen.shape, np.uint8), cv2.convexHull(places.astype(np.float32))
    cv2.fillConvexPoly(outline, np.rint(hull * 16).astype(np.int32), 1, shift=4)
    inside, whole = int(outline.sum()), float(cv2.contourArea(hull))
    count = int(seen.sum())
    if inside < _LEAST_AREA_PX:
        return None
    unhidden = min(count / inside, 1.0)
    share = unhidden * min(inside / whole, 1.0)
    low, high = places.min(0), places.max(0)
    limit = np.array([seen.shape[1] - 0.5, seen.shape[0] - 0.5])
    cut = bool((low < -0.5).any() or (high > limit).any())
    if unhidden < _CLEAR_SHARE - 2.0 / np.sqrt(inside) and count:
        rows, columns = np.flatnonzero(seen.any(1)), np.flatnonzero(seen.any(0))
        box = [columns[0] - 0.5, rows[0] - 0.5, columns[-1] + 0.5, rows[-1] + 0.5]
        return Label([float(v) for v in box], share, cut)
    box = [*np.maximum(low, -0.5), *np.minimum(high, limit)]
    return Label([float(v) for v in box], share, cut)
