"""A part of an image at another scale, cropped around a box."""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box
from vergence_metric.disparity.fovea_pair import cut

_ANTIALIAS = 0.45


@dataclass(frozen=True)
class Crop:
    """Where a crop lies: its first pixel's centre (x0, y0) [px], image pixels per pixel, size (width, height)."""

    x0: float
    y0: float
    scale: float
    size: tuple[int, int]

    def moved(self, by: tuple[float, float]) -> "Crop":
        """Return the crop of the same size where things lie that are seen moved by a disparity (x, y) [px]."""
        return Crop(self.x0 - by[0], self.y0 - by[1], self.scale, self.size)

    def of(self, image: NDArray[Any]) -> NDArray[np.uint8]:
        """Return the crop of a grey image; beyond the image its border is repeated."""
        s, (width, height) = self.scale, self.size
        pad = 2 + math.ceil(2 * s)
        left, top = math.floor(self.x0) - pad, math.floor(self.y0) - pad
        source = cut(image, left, top, math.ceil(width * s) + 2 * pad + 1, math.ceil(height * s) + 2 * pad + 1)
        if s > 1.3:
            source = np.asarray(cv2.GaussianBlur(source, (0, 0), _ANTIALIAS * s))
        matrix = np.array([[s, 0.0, self.x0 - left], [0.0, s, self.y0 - top]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(source, matrix, self.size, flags=flags), np.uint8)

    def inside(self, box: Box) -> NDArray[np.bool_]:
        """Return which pixels (h, w) lie in a box."""
        x = self.x0 + self.scale * np.arange(self.size[0])
        y = self.y0 + self.scale * np.arange(self.size[1])
        x_min, y_min, x_max, y_max = box.xyxy_px
        # The outermost pixels are half background.
        columns, rows = (x > x_min + 0.5) & (x < x_max - 0.5), (y > y_min + 0.5) & (y < y_max - 0.5)
        return np.asarray(rows[:, None] & columns[None, :])
