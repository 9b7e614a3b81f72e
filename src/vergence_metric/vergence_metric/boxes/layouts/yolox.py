"""YOLOX."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.layouts.grid import GridLayout, cell_centres, cells, objectness_is_one
from vergence_metric.boxes.layouts.protocol import Array, WarmUp
from vergence_metric.boxes.preprocessing import Preprocessing

_LARGEST_LOG = 12.0  # a size of e^12 strides is no object's


class YoloX(GridLayout):
    """`[1, N, 5 + classes]` as YOLOv6 has it, but boxes are offsets and logarithms in strides. Input: BGR bytes."""

    name = "yolox"
    description = "rows of undecoded centre and size, objectness and class scores"

    def contradiction(self, warm_up: WarmUp) -> str:
        """See Layout: scores are shares, boxes are not in pixels, sizes are logarithms."""
        slope = self.grid_slope(warm_up)
        if slope > 0.5:
            return f"its centres must be offsets from the cells: from cell to cell they change by {slope:.2g} cells"
        largest = float(self._warm_up_rows(warm_up)[:, 2:4].max())
        if largest > _LARGEST_LOG:
            return f"its sizes must be logarithms: got up to {largest:.3g}"
        return self._scores_contradiction(warm_up)

    def preprocessing(self, dtype: Any) -> Preprocessing:
        """Return BGR, 0 to 255, borders right and below only."""
        return Preprocessing("bgr", False, "corner")

    def boxes(self, boxes: Array, places: NDArray[np.int64], input_px: tuple[int, int]) -> Array:
        """Return centre and size [px] of offsets from cells and logarithms of sizes, both in strides."""
        corners = np.concatenate([cell_centres(input_px, s) - 0.5 * s for s in self.strides])[places]
        counts = [cells(input_px, (s,)) for s in self.strides]
        stride_of = np.repeat(self.strides, counts)[places][:, None]
        return np.concatenate([boxes[:, :2] * stride_of + corners, np.exp(boxes[:, 2:]) * stride_of], axis=1)


class YoloXDecoded(YoloX):
    """YOLOX exported with `--decode_in_inference`: boxes in pixels."""

    name = "yolox_decoded"
    description = "rows of centre, size, objectness and class scores, one row a cell; input as YOLOX"

    def contradiction(self, warm_up: WarmUp) -> str:
        """See Layout: as rows in pixels, with an objectness that differs from cell to cell."""
        if objectness_is_one(self._warm_up_rows(warm_up)):
            return "its objectness must differ from cell to cell: it is 1 throughout, as YOLOv6 has it"
        if warm_up.output_names[self.outputs[0]] == "outputs":
            return "its output must not have the name 'outputs' of YOLOv6's"
        return GridLayout.contradiction(self, warm_up)

    def boxes(self, boxes: Array, places: NDArray[np.int64], input_px: tuple[int, int]) -> Array:
        """Return the boxes as they are."""
        return boxes
