"""Crops of both eyes about one point of the left image, at several resolutions, cut once and shared."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.protocol import Image

Grey = NDArray[np.float32]


def cut(image: Image, x0: int, y0: int, width: int, height: int) -> Image:
    """Return the (height, width) crop whose top-left pixel is (x0, y0); beyond the image its border is repeated."""
    h, w = image.shape
    inside = image[max(y0, 0) : max(min(y0 + height, h), 0), max(x0, 0) : max(min(x0 + width, w), 0)]
    if inside.shape == (height, width):
        return inside
    if inside.size:
        top, left, bottom, right = max(-y0, 0), max(-x0, 0), max(y0 + height - h, 0), max(x0 + width - w, 0)
        return np.asarray(cv2.copyMakeBorder(inside, top, bottom, left, right, cv2.BORDER_REPLICATE))
    xs = np.clip(np.arange(x0, x0 + width), 0, w - 1)
    ys = np.clip(np.arange(y0, y0 + height), 0, h - 1)
    return image[np.ix_(ys, xs)]


@dataclass(frozen=True)
class Strip:
    """A float crop: pixel (x, y) of the image at this resolution is `grey[y - y0, x - x0]`."""

    grey: Grey
    x0: float
    y0: float

    def columns(self, first: int, end: int) -> "Strip":
        """Return the part from the image's column `first` to `end`, half open, as far as there is one."""
        start = max(first - int(self.x0), 0)
        return Strip(self.grey[:, start : max(end - int(self.x0), start)], self.x0 + start, self.y0)


@dataclass(frozen=True)
class FoveaPair:
    """Both images about a point: `reach_px` is the largest |disparity|, `margin_px` the largest window radius."""

    left: Image
    right: Image
    point_px: tuple[float, float]
    reach_px: int
    vertical_px: int
    margin_px: int

    def _strip(self, image: Image, halvings: int) -> Strip:
        """Cut about the point, from a multiple of 2^halvings, so that the pixels of every level lie on one grid."""
        step = 1 << halvings
        across = self.reach_px + self.margin_px + 4 * step
        down = self.vertical_px + self.margin_px + 4 * step
        x0 = (round(self.point_px[0]) - across) // step * step
        y0 = (round(self.point_px[1]) - down) // step * step
        crop = cut(image, x0, y0, 2 * across + step + 1, 2 * down + step + 1)
        for _ in range(halvings):
            crop = cv2.pyrDown(crop)
        return Strip(crop.astype(np.float32), x0 / step, y0 / step)

    @cached_property
    def full(self) -> tuple[Strip, Strip]:
        """Left and right strip at full resolution."""
        return self._strip(self.left, 0), self._strip(self.right, 0)

    @cached_property
    def half(self) -> tuple[Strip, Strip]:
        """Left and right strip at half resolution (pyrDown: pixel i lies at full-resolution pixel 2 i)."""
        return self._strip(self.left, 1), self._strip(self.right, 1)
