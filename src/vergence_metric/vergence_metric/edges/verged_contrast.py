"""The contrast that a pair would have if the eyes were verged on a point of it: its right view is moved, not the eyes.

A turn of a camera about its optical centre moves its image. So each distance that a point may have can be looked at in
one pair: the point is where the images agree.
"""

import cv2
import numpy as np

from vergence_metric.edges.contrast import foveal_contrast
from vergence_metric.edges.edges import Grey, detect_edges
from vergence_metric.edges.oriented_edges import oriented_field
from vergence_metric.edges.parameters import ContrastParameters, EdgeParameters
from vergence_metric.edges.windows import centre_window

_HALF_PX = 80  # of the view about the point that is cut out
_WINDOW_PX = 100


def contrast_if_verged(
    left: Grey,
    right: Grey,
    left_px: tuple[float, float],
    right_px: tuple[float, float],
    edges: EdgeParameters | None = None,
    contrast: ContrastParameters | None = None,
) -> float:
    """Return the foveal contrast about a pixel of the left and one of the right image; NaN without edges.

    Args:
        left: (h, w) grey image.
        right: (h, w) grey image.
        left_px: pixel (x, y) of the left image.
        right_px: pixel (x, y) of the right image where the point would be.
        edges: how edges are detected, None for the defaults.
        contrast: how the contrast is measured, None for the defaults.

    """
    e, c, side = edges or EdgeParameters(), contrast or ContrastParameters(), 2 * _HALF_PX + 1
    views = (cv2.getRectSubPix(image, (side, side), px) for image, px in ((left, left_px), (right, right_px)))
    seen = [detect_edges(np.asarray(view, np.uint8), e) for view in views]
    windows = (centre_window(_WINDOW_PX, side, side),)
    bins, signed = c.orientation_bins, c.orientation_signed
    field = oriented_field(seen[0], seen[1], windows, bins=bins, signed=signed, truncation_px=c.truncation_px)
    return foveal_contrast(field, c.truncation_px, c.foveal_sigma_px)
