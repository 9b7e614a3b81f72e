"""Which pixels about a point are of its own surface: those that the right eye sees at its disparity and at no other.

A lens that lies off its axis moves as the eye turns. What is nearer or farther than the point has moved against it
then, and says nothing of where the point is.
"""

from collections.abc import Sequence
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import Pixel
from vergence_metric.tracking.reduced import reduced

Floats = NDArray[np.float32]

HALF_PX = 50
"""How far about the point its surface is separated from others: as far as a remembered patch compares them."""

_WINDOW = (7, 7)
_OWN_CORRELATION = 0.7
_OTHERS_PX = (*range(-24, -3, 3), *range(6, 25, 3))  # disparities at which other surfaces may lie, from the point's
_HEIGHTS_PX = range(-4, 5, 2)  # differences in height that eyes that verge leave between both images
_LEAD = 0.1  # in correlation, over any other disparity: edges along the baseline fit at all of them
_NOISE_VARIANCE = 4.0  # [grey levels^2]


class SurfaceMasks:
    """Masks of the surface of a point of a pair, for each distance that the point may have.

    Args:
        left: (h, w) grey image.
        right: (h, w) grey image, aligned.
        at: pixel (x, y) of the left image.
        distances: each as (parallax [rad], disparity [px]), the likeliest first.
        apart_rad: parallaxes that differ by less may be the same.
    """

    def __init__(
        self, left: Image, right: Image, at: Pixel, distances: Sequence[tuple[float, float]], apart_rad: float
    ) -> None:
        self._images, self._at = (left, right), at
        self._distances, self._apart_rad = distances, apart_rad
        self._mask = cache(self._computed)

    def mask(self, parallax_rad: float, scale: int) -> Image | None:
        """Return the mask (h, w) of the surface at a parallax, reduced by a scale; None if none was seen there."""
        near = (px for angle, px in self._distances if abs(angle - parallax_rad) <= self._apart_rad)
        disparity_px = next(near, None)
        return None if disparity_px is None else self._mask(disparity_px, scale)

    def _computed(self, disparity_px: float, scale: int) -> Image:
        if scale > 1:
            return reduced(self._mask(disparity_px, 1), scale)
        return own_pixels(*self._images, self._at, disparity_px, HALF_PX)


def own_pixels(left: Image, right: Image, at: Pixel, disparity_px: float, half_px: int) -> NDArray[np.uint8]:
    """Return a mask (h, w) of the left image: 255 within `half_px` of a pixel where the surface there is seen, else 0.

    Args:
        left: (h, w) grey image.
        right: (h, w) grey image, aligned.
        at: pixel (x, y) of the left image.
        disparity_px: its disparity, left minus right.
        half_px: how far about the pixel.
    """
    mask = np.zeros(left.shape, np.uint8)
    x0, y0, side = round(at[0]) - half_px, round(at[1]) - half_px, 2 * half_px + 1
    seen = _Windows(cut(left, x0, y0, side, side))
    most_px, high_px = max(_OTHERS_PX), max(_HEIGHTS_PX)
    there = cut(right, x0 - round(disparity_px) - most_px, y0 - high_px, side + 2 * most_px, side + 2 * high_px)
    other = _Windows(there)

    def correlation(off_px: int) -> Floats:
        rows = (high_px + height for height in _HEIGHTS_PX)
        return np.asarray(np.max([seen.correlation(other, most_px - off_px, row) for row in rows], axis=0))

    own = correlation(0)
    others = np.max([correlation(off_px) for off_px in _OTHERS_PX], axis=0)
    found = (own > _OWN_CORRELATION) & (own > others + _LEAD)
    height, width = left.shape
    x1, y1 = min(x0 + side, width), min(y0 + side, height)
    left_px, top_px = max(x0, 0), max(y0, 0)
    mask[top_px:y1, left_px:x1] = np.where(found[top_px - y0 : y1 - y0, left_px - x0 : x1 - x0], 255, 0)
    return mask


class _Windows:
    """An image (h, w) with the mean and the variance about each of its pixels."""

    def __init__(self, image: Image) -> None:
        self.values = image.astype(np.float32)
        self.mean = np.asarray(cv2.blur(self.values, _WINDOW))
        self.variance = np.asarray(cv2.blur(self.values**2, _WINDOW)) - self.mean**2 + _NOISE_VARIANCE

    def correlation(self, other: "_Windows", column: int, row: int) -> Floats:
        """Return the correlation (h, w) with the part of a larger image that begins at a column and a row."""
        height, width = self.values.shape
        values, mean, variance = (
            part[row : row + height, column : column + width] for part in (other.values, other.mean, other.variance)
        )
        shared = np.asarray(cv2.blur(self.values * values, _WINDOW)) - self.mean * mean
        return np.asarray(shared / np.sqrt(self.variance * variance), np.float32)
