"""How a fitted picture becomes the network's input tensor: order and range of its channels, grey of its borders."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.letterbox import BORDER_GREY

COLORS = ("rgb", "bgr")
SCALES = ("unit", "byte")
"""Values from 0 to 1, or from 0 to 255."""


@dataclass(frozen=True)
class Preprocessing:
    """Order of the channels (one of COLORS), whether values are 0..1, the resize (see `letterbox.RESIZES`).

    `border` is the grey level of what lies beyond the image.
    """

    color: str
    unit_scale: bool
    resize: str
    border: int = BORDER_GREY

    def overridden(self, color: str, scale: str, resize: str) -> "Preprocessing":
        """Return this with what is not "auto" replaced; `scale` is one of SCALES."""
        return Preprocessing(
            self.color if color == "auto" else color,
            self.unit_scale if scale == "auto" else scale == "unit",
            self.resize if resize == "auto" else resize,
            self.border,
        )

    def tensor(self, pictures: Sequence[NDArray[np.uint8]], dtype: Any) -> NDArray[Any]:
        """Return the input (B, 3, h, w) of element type `dtype` of B BGR pictures (h, w, 3) of one size."""
        tensor = np.empty((len(pictures), 3, *pictures[0].shape[:2]), dtype)
        # Plane by plane: converting the interleaved picture as a whole takes five times as long.
        for planes, picture in zip(tensor, pictures, strict=True):
            for plane, channel in zip(planes[:: -1 if self.color == "rgb" else 1], cv2.split(picture), strict=True):
                if self.unit_scale:
                    np.multiply(channel, dtype(1.0 / 255.0), out=plane)
                else:
                    plane[:] = channel
        return tensor

    def __str__(self) -> str:
        return f"{self.color} {'0..1' if self.unit_scale else '0..255'} by {self.resize}"
