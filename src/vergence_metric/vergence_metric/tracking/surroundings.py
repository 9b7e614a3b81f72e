"""How far away the surroundings of a point are as a whole: where both eyes' wide views of them match best."""

import cv2
import numpy as np

from vergence_metric.disparity.correlation import peak_offset
from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import Pixel
from vergence_metric.tracking.reduced import levelled, reduced

WIDE_HALF_PX, WIDE_SCALE = 160, 4
"""Half side of the wide view about a point, and by what it is reduced before it is compared."""

_REACH_PX, _HEIGHT_PX = 160, 8  # disparities searched, across and down
_LEAST_SIMILARITY = 0.2  # of views of equal contrast, reduced: chance gives 0.15


def surroundings_disparity(left: Image, right: Image, at: Pixel) -> float | None:
    """Return the disparity of most of what surrounds a pixel [px]; None where the views are too unlike each other.

    Args:
        left: (h, w) grey image.
        right: (h, w) grey image, aligned.
        at: pixel (x, y) of the left image.

    """
    height, width = left.shape
    x0, y0 = max(round(at[0]) - WIDE_HALF_PX, 0), max(round(at[1]) - WIDE_HALF_PX, 0)
    x1, y1 = min(round(at[0]) + WIDE_HALF_PX, width), min(round(at[1]) + WIDE_HALF_PX, height)
    template = _compared(np.ascontiguousarray(left[y0:y1, x0:x1]))
    area = cut(right, x0 - _REACH_PX, y0 - _HEIGHT_PX, x1 - x0 + 2 * _REACH_PX, y1 - y0 + 2 * _HEIGHT_PX)
    surface = np.asarray(cv2.matchTemplate(_compared(area), template, cv2.TM_CCOEFF_NORMED))
    j, i = divmod(int(surface.argmax()), surface.shape[1])
    if not surface[j, i] >= _LEAST_SIMILARITY:
        return None
    return _REACH_PX - WIDE_SCALE * (i + peak_offset(surface, i, j)[0])


def _compared(image: Image) -> Image:
    return levelled(reduced(image, WIDE_SCALE), WIDE_SCALE)
