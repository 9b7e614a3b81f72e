"""The contrast that a pair would have if the eyes were verged on a point of it: its right view is moved, not the eyes.

A turn of a camera about its optical centre moves its image. So each distance that a point may have can be looked at in
one pair: the point is where the images agree.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.contrast import foveal_contrast
from vergence_metric.edges.edges import Edges, Grey, detect_edges
from vergence_metric.edges.oriented_edges import OrientedEdges, oriented_field
from vergence_metric.edges.parameters import ContrastParameters, EdgeParameters
from vergence_metric.edges.windows import centre_window

_SIDE_PX = 161  # of the view about the point that is cut out
_WINDOW_PX = 100


def contrasts_if_verged(
    left: Grey, right: Grey, left_px: tuple[float, float], right_px: Sequence[tuple[float, float]]
) -> NDArray[np.float64]:
    """Return the foveal contrast (n,) about a pixel of the left image and each of the right one; NaN without edges.

    Args:
        left: (h, w) grey image.
        right: (h, w) grey image.
        left_px: pixel (x, y) of the left image.
        right_px: pixels (x, y) of the right image, n of them, where the point would be.

    """
    contrast, windows = ContrastParameters(), (centre_window(_WINDOW_PX, _SIDE_PX, _SIDE_PX),)
    bins, signed, truncation_px = contrast.orientation_bins, contrast.orientation_signed, contrast.truncation_px
    found: list[float] = []
    here: Edges | OrientedEdges = _edges_about(left, left_px)
    for px in right_px:
        there = _edges_about(right, px)
        field = oriented_field(here, there, windows, bins=bins, signed=signed, truncation_px=truncation_px)
        here = field.images[0]
        found.append(foveal_contrast(field, truncation_px, contrast.foveal_sigma_px))
    return np.array(found)


def _edges_about(image: Grey, px: tuple[float, float]) -> Edges:
    view = cv2.getRectSubPix(image, (_SIDE_PX, _SIDE_PX), px)
    return detect_edges(np.asarray(view, np.uint8), EdgeParameters())
