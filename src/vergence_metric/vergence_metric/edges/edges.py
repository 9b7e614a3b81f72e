"""Edges of one image: grey, Gaussian blur, gradient, Canny, as in the paper's flowchart."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.parameters import EdgeParameters
from vergence_metric.edges.scratch import Scratch

Grey = NDArray[np.uint8]
Gradient = NDArray[np.int16]

_SAMPLING = 4  # thresholds are taken from every 4th row and column


class ImageShapeError(ValueError):
    """An image that is neither (h, w) nor (h, w, 3) uint8, or two of different sizes."""


@dataclass(frozen=True)
class Edges:
    """Edge pixels of one image with the gradient they were found in.

    `mask` (h, w) uint8 is 255 at edge pixels; `gradient_x`, `gradient_y` (h, w) int16 are Sobel derivatives of the
    blurred image, x right and y down; `low` and `high` are the thresholds used [grey levels].
    """

    mask: Grey
    gradient_x: NDArray[np.int16]
    gradient_y: NDArray[np.int16]
    low: float
    high: float

    @cached_property
    def count(self) -> int:
        """Edge pixels in the whole image."""
        return int(cv2.countNonZero(self.mask))


def to_grey(image: NDArray[Any]) -> Grey:
    """Return the (h, w) uint8 grey image of a (h, w) grey or (h, w, 3) BGR uint8 `image`.

    A grey image is returned as it is, not copied. Raises ImageShapeError for anything else.
    """
    if image.dtype != np.uint8 or image.size == 0:
        raise ImageShapeError(f"image must be uint8 and not empty: got {image.dtype} of shape {image.shape}")
    if image.ndim == 2:
        return image
    if image.ndim == 3 and image.shape[2] == 3:
        return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    raise ImageShapeError(f"image must be (h, w) grey or (h, w, 3) BGR: got shape {image.shape}")


def detect_edges(grey: Grey, parameters: EdgeParameters) -> Edges:
    """Return the edges of a (h, w) uint8 `grey` image.

    Canny thins the gradient to one pixel and follows edges from the upper down to the lower threshold. Raises
    ImageShapeError where `grey` is not a grey image.
    """
    blurred = _blurred(grey, parameters)
    gradient_x, gradient_y = _gradients(blurred)
    samples = gradient_x[::_SAMPLING, ::_SAMPLING], gradient_y[::_SAMPLING, ::_SAMPLING]
    return _canny(gradient_x, gradient_y, _thresholds(*samples, parameters))


def detect_edges_within(grey: Grey, parameters: EdgeParameters, area: tuple[slice, slice], scratch: Scratch) -> Edges:
    """Return the edges in an area (rows, columns) of a (h, w) uint8 `grey` image; arrays are of the area's size.

    They are those of `detect_edges` there, except at the area's border, and for weak ones that join a strong one
    outside of the area only. The thresholds are the whole image's. The gradients are good until `scratch` is used for
    the next image.
    """
    blurred = _blurred(grey, parameters, scratch.array("blurred", grey.shape, np.uint8))
    rows, columns = area
    top, left = max(rows.start - 1, 0), max(columns.start - 1, 0)
    around = blurred[top : rows.stop + 1, left : columns.stop + 1]
    buffers = scratch.array("gradient x", around.shape, np.int16), scratch.array("gradient y", around.shape, np.int16)
    inside = slice(rows.start - top, rows.stop - top), slice(columns.start - left, columns.stop - left)
    gradient_x, gradient_y = (gradient[inside] for gradient in _gradients(around, buffers))
    thresholds = _thresholds(*_sampled_gradients(blurred, scratch), parameters)
    return _canny(gradient_x, gradient_y, thresholds)


def _blurred(grey: Grey, parameters: EdgeParameters, buffer: Grey | None = None) -> Grey:
    if grey.ndim != 2 or grey.dtype != np.uint8 or grey.size == 0:
        raise ImageShapeError(f"grey image must be (h, w) uint8 and not empty: got {grey.dtype} of shape {grey.shape}")
    if parameters.blur_sigma_px > 0.0:
        return np.asarray(cv2.GaussianBlur(grey, (0, 0), parameters.blur_sigma_px, dst=buffer), np.uint8)
    return grey


def _gradients(
    blurred: Grey, buffers: tuple[Gradient | None, Gradient | None] = (None, None)
) -> tuple[Gradient, Gradient]:
    """Return both Sobel derivatives, in the buffers if there are any."""
    gradient_x, gradient_y = cv2.spatialGradient(blurred, *buffers, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(gradient_x, np.int16), np.asarray(gradient_y, np.int16)


def _sampled_gradients(blurred: Grey, scratch: Scratch) -> tuple[Gradient, Gradient]:
    """Return both Sobel derivatives of every 4th row and column, without those between."""
    height, width = blurred.shape
    bordered = scratch.array("bordered", (height + 2, width + 2), np.uint8)
    cv2.copyMakeBorder(blurred, 1, 1, 1, 1, cv2.BORDER_REPLICATE, dst=bordered)
    rows, columns = ([slice(i, i + n, _SAMPLING) for i in range(3)] for n in (height, width))
    above, here, below = ([bordered[row, column].astype(np.int16) for column in columns] for row in rows)
    gradient_x = above[2] - above[0] + 2 * (here[2] - here[0]) + below[2] - below[0]
    gradient_y = below[0] - above[0] + 2 * (below[1] - above[1]) + below[2] - above[2]
    return gradient_x, gradient_y


def _thresholds(gradient_x: Gradient, gradient_y: Gradient, parameters: EdgeParameters) -> tuple[float, float]:
    """Return Canny's lower and upper threshold for an image with these derivatives at samples [grey levels].

    Automatic ones: the upper threshold is the gradient (|dx| + |dy|, Canny's own measure) that a share
    `auto_edge_share` of the samples exceeds, so that a change of exposure or gain scales it as it scales the gradients;
    it never falls below `auto_floor`.
    """
    if parameters.threshold_mode == "fixed":
        return parameters.canny_low, parameters.canny_high
    magnitude = np.abs(gradient_x)  # no more than 1020, as Sobel's of a byte image: counting is faster than sorting
    magnitude += np.abs(gradient_y)
    rank = round((1.0 - parameters.auto_edge_share) * (magnitude.size - 1))
    ranked = np.searchsorted(np.bincount(magnitude.ravel()).cumsum(), rank, side="right")
    high = max(float(ranked), parameters.auto_floor)
    return parameters.auto_low_ratio * high, high


def _canny(gradient_x: Gradient, gradient_y: Gradient, thresholds: tuple[float, float]) -> Edges:
    mask = cv2.Canny(gradient_x, gradient_y, *thresholds)
    return Edges(np.asarray(mask, np.uint8), gradient_x, gradient_y, *thresholds)
