"""YOLOX."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.layouts.grid import GridLayout
from vergence_metric.boxes.layouts.protocol import Array, WarmUp
from vergence_metric.boxes.preprocessing import Preprocessing


class YoloX(GridLayout):
    """`[1, N, 5 + classes]` as YOLOv6 has it, but boxes are offsets and logarithms in strides. Input: BGR bytes."""

    name = "yolox"
    description = "rows of undecoded centre and size, objectness and class scores"

    def values_agree(self, warm_up: WarmUp) -> bool:
        """Return whether scores are at most 1 and boxes are not in pixels."""
        return self._scores_are_shares(warm_up) and not self._in_pixels(warm_up)

    def preprocessing(self, dtype: Any) -> Preprocessing:
        """Return BGR, 0 to 255, borders right and below only."""
        return Preprocessing("bgr", False, "corner")

    def boxes(self, boxes: Array, places: NDArray[np.int64], input_px: tuple[int, int]) -> Array:
        """Return centre and size [px] of offsets from cells and logarithms of sizes, both in strides."""
        grid, scale = [], []
        for stride in self.strides:
            columns, rows = -(-input_px[0] // stride), -(-input_px[1] // stride)
            y, x = np.mgrid[0:rows, 0:columns]
            grid.append(np.column_stack([x.ravel(), y.ravel()]))
            scale.append(np.full(rows * columns, stride))
        cell, stride_of = np.concatenate(grid)[places], np.concatenate(scale)[places][:, None]
        return np.concatenate([(boxes[:, :2] + cell) * stride_of, np.exp(boxes[:, 2:]) * stride_of], axis=1)
