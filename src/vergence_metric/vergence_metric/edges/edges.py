"""Edges of one image: grey, Gaussian blur, gradient, Canny, as in the paper's flowchart."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.parameters import EdgeParameters

Grey = NDArray[np.uint8]
Gradient = NDArray[np.int16]
Thresholds = tuple[float, float]
"""Canny's lower and upper one [grey levels]."""

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


def detect_edges(grey: Grey, parameters: EdgeParameters, thresholds: Thresholds | None = None) -> Edges:
    """Return the edges of a (h, w) uint8 `grey` image, by its own thresholds if none are given.

    Canny thins the gradient to one pixel and follows edges from the upper down to the lower threshold. Raises
    ImageShapeError where `grey` is not a grey image.
    """
    gradient_x, gradient_y = gradients(blurred(grey, parameters))
    return canny(gradient_x, gradient_y, thresholds or thresholds_of(gradient_x, gradient_y, parameters))


def blurred(grey: Grey, parameters: EdgeParameters, buffer: Grey | None = None) -> Grey:
    """Return the (h, w) grey image blurred, in the buffer if there is one; raises ImageShapeError for another."""
    if grey.ndim != 2 or grey.dtype != np.uint8 or grey.size == 0:
        raise ImageShapeError(f"grey image must be (h, w) uint8 and not empty: got {grey.dtype} of shape {grey.shape}")
    if parameters.blur_sigma_px > 0.0:
        return np.asarray(cv2.GaussianBlur(grey, (0, 0), parameters.blur_sigma_px, dst=buffer), np.uint8)
    return grey


def gradients(
    image: Grey, buffer_x: Gradient | None = None, buffer_y: Gradient | None = None
) -> tuple[Gradient, Gradient]:
    """Return both Sobel derivatives, in the buffers if there are any."""
    gradient_x, gradient_y = cv2.spatialGradient(image, buffer_x, buffer_y, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(gradient_x, np.int16), np.asarray(gradient_y, np.int16)


def thresholds_of(gradient_x: Gradient, gradient_y: Gradient, parameters: EdgeParameters) -> Thresholds:
    """Return Canny's lower and upper threshold for an image with these derivatives [grey levels].

    Automatic ones: the upper threshold is the gradient (|dx| + |dy|, Canny's own measure) that a share
    `auto_edge_share` of samples exceeds, so that a change of exposure or gain scales it as it scales the gradients;
    it never falls below `auto_floor`.
    """
    if parameters.threshold_mode == "fixed":
        return parameters.canny_low, parameters.canny_high
    samples_x, samples_y = (gradient[::_SAMPLING, ::_SAMPLING] for gradient in (gradient_x, gradient_y))
    # No more than 1020, as Sobel's of a byte image: counting is faster than sorting.
    magnitude = np.abs(samples_x) + np.abs(samples_y)
    rank = round((1.0 - parameters.auto_edge_share) * (magnitude.size - 1))
    ranked = np.searchsorted(np.bincount(magnitude.ravel()).cumsum(), rank, side="right")
    high = max(float(ranked), parameters.auto_floor)
    return parameters.auto_low_ratio * high, high


def canny(gradient_x: Gradient, gradient_y: Gradient, thresholds: Thresholds) -> Edges:
    """Return the edges of an image with these derivatives."""
    mask = cv2.Canny(gradient_x, gradient_y, *thresholds)
    return Edges(np.asarray(mask, np.uint8), gradient_x, gradient_y, *thresholds)
