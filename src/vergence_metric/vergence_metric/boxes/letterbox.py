"""How an image becomes the network's input, and how boxes come back.

Detectors count from the outer corner of the top-left pixel; the rest of this package from its centre, half a pixel off.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

RESIZES = ("letterbox", "stretch", "corner")
"""With borders all round (YOLOv5 to 11), without borders, or with borders right and below (YOLOX)."""

BORDER_GREY = 114
"""Of what lies beyond the image in the input of most networks."""


@dataclass(frozen=True)
class Letterbox:
    """Fits images of one size into an input of one size; sizes are (width, height) [px]."""

    source_px: tuple[int, int]
    input_px: tuple[int, int]
    fitted_px: tuple[int, int]
    offset_px: tuple[int, int]

    @classmethod
    def fit(cls, source_px: tuple[int, int], input_px: tuple[int, int], resize: str = "letterbox") -> "Letterbox":
        """Return the largest fit that keeps the sides' ratio (`stretch`: the whole input)."""
        if resize == "stretch":
            return cls(source_px, input_px, input_px, (0, 0))
        ratio = min(input_px[0] / source_px[0], input_px[1] / source_px[1])
        fitted = (
            min(max(round(source_px[0] * ratio), 1), input_px[0]),
            min(max(round(source_px[1] * ratio), 1), input_px[1]),
        )
        if resize == "corner":
            return cls(source_px, input_px, fitted, (0, 0))
        # The family's rounding: an odd border is larger right and below.
        left, top = (round((whole - part) / 2 - 0.1) for whole, part in zip(input_px, fitted, strict=True))
        return cls(source_px, input_px, fitted, (left, top))

    @property
    def scale(self) -> tuple[float, float]:
        """Input pixels per source pixel, across and down."""
        return self.fitted_px[0] / self.source_px[0], self.fitted_px[1] / self.source_px[1]

    def place(self, image: NDArray[np.uint8], border: int = BORDER_GREY) -> NDArray[np.uint8]:
        """Return the input picture (height, width, 3) of an image (h, w, 3) of the source size; grey beyond it."""
        fitted = image
        if self.fitted_px != self.source_px:
            fitted = np.asarray(cv2.resize(image, self.fitted_px, interpolation=cv2.INTER_LINEAR))
        if self.fitted_px == self.input_px:
            return fitted
        picture = np.full((self.input_px[1], self.input_px[0], 3), border, np.uint8)
        (left, top), (width, height) = self.offset_px, self.fitted_px
        picture[top : top + height, left : left + width] = fitted
        return picture

    def to_source(self, xyxy_input: NDArray[Any]) -> NDArray[np.float64]:
        """Return boxes (N, 4) in raw pixels of the source from boxes in the input's (counted from its corner)."""
        return self.points_to_source(np.asarray(xyxy_input).reshape(-1, 2, 2)).reshape(-1, 4)

    def points_to_source(self, points_input: NDArray[Any]) -> NDArray[np.float64]:
        """Return points (..., 2) in raw pixels of the source from points in the input's (counted from its corner)."""
        return (np.asarray(points_input, np.float64) - self.offset_px) / self.scale - 0.5

    def to_input(self, xyxy_px: NDArray[Any]) -> NDArray[np.float64]:
        """Return boxes (N, 4) in the input's pixels from boxes in raw pixels of the source."""
        boxes = np.asarray(xyxy_px, np.float64).reshape(-1, 4)
        return (boxes + 0.5) * (self.scale * 2) + self.offset_px * 2
