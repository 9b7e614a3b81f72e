"""Edges of one image: grey, Gaussian blur, gradient, Canny, as in the paper's flowchart."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.parameters import EdgeParameters

Grey = NDArray[np.uint8]

_SAMPLING = 4


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


def automatic_thresholds(
    gradient_x: NDArray[np.int16], gradient_y: NDArray[np.int16], parameters: EdgeParameters
) -> tuple[float, float]:
    """Return Canny's lower and upper threshold for an image with these derivatives [grey levels].

    The upper threshold is the gradient (|dx| + |dy|, Canny's own measure) that a share `auto_edge_share` of the pixels
    exceeds, so that a change of exposure or gain scales it as it scales the gradients; it never falls below
    `auto_floor`. The percentile is taken on every 4th row and column.
    """
    magnitude = np.abs(gradient_x[::_SAMPLING, ::_SAMPLING])  # no more than 1020, as Sobel's of a byte image
    magnitude += np.abs(gradient_y[::_SAMPLING, ::_SAMPLING])
    rank = round((1.0 - parameters.auto_edge_share) * (magnitude.size - 1))
    high = max(float(np.partition(magnitude, rank, axis=None)[rank]), parameters.auto_floor)
    return parameters.auto_low_ratio * high, high


def detect_edges(grey: Grey, parameters: EdgeParameters) -> Edges:
    """Return the edges of a (h, w) uint8 `grey` image.

    Canny thins the gradient to one pixel and follows edges from the upper down to the lower threshold. Raises
    ImageShapeError where `grey` is not a grey image.
    """
    if grey.ndim != 2 or grey.dtype != np.uint8 or grey.size == 0:
        raise ImageShapeError(f"grey image must be (h, w) uint8 and not empty: got {grey.dtype} of shape {grey.shape}")
    if parameters.blur_sigma_px > 0.0:
        grey = cv2.GaussianBlur(grey, (0, 0), parameters.blur_sigma_px)
    gradient_x, gradient_y = cv2.spatialGradient(grey, borderType=cv2.BORDER_REPLICATE)  # both Sobel derivatives
    if parameters.threshold_mode == "fixed":
        low, high = parameters.canny_low, parameters.canny_high
    else:
        low, high = automatic_thresholds(gradient_x, gradient_y, parameters)
    mask = cv2.Canny(gradient_x, gradient_y, low, high)
    return Edges(mask, gradient_x, gradient_y, low, high)
