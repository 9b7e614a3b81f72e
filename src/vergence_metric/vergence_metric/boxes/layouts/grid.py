"""Base of the layouts with one or more rows for every cell of the strides' grids."""

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.layouts.protocol import Array, Candidates, Layout, Output, WarmUp

STRIDE_SETS = ((8, 16, 32), (8, 16, 32, 64), (8, 16), (4, 8, 16, 32), (16, 32))


class GridLayout(Layout):
    """Rows of centre and size, then objectness where there is one, then a score for each class."""

    rows_per_cell: ClassVar[int] = 1
    objectness: ClassVar[bool] = True

    @classmethod
    def rows(cls, output: Output) -> Output:
        """Return the rows (N, columns) of one image from its output (N, columns)."""
        return output

    @classmethod
    def matches(cls, warm_up: WarmUp) -> Layout | None:
        """Return this layout for the first output that has the right number of rows for one of the STRIDE_SETS."""
        for index, output in enumerate(warm_up.outputs):
            if output.ndim != 3 or output.shape[0] != 1:
                continue
            count, columns = cls.rows(output[0]).shape
            classes = columns - cls._first_class()
            if classes < 1 or warm_up.class_count not in (None, classes):
                continue
            for strides in STRIDE_SETS:
                if count == cls.rows_per_cell * cells(warm_up.input_px, strides):
                    return cls((index,), classes, strides)
        return None

    def values_agree(self, warm_up: WarmUp) -> bool:
        """Return whether scores are at most 1 and boxes are centres and sizes in pixels."""
        return self._scores_are_shares(warm_up) and self._in_pixels(warm_up)

    def explains(self, output: Output, warm_up: WarmUp) -> bool:
        """Return whether an output is the map of one stride before decoding: the grid's sides stand in its shape."""
        sides = {tuple(math.ceil(side / s) for side in reversed(warm_up.input_px)) for s in self.strides}
        pairs = {tuple(output.shape[i : i + 2]) for i in range(1, output.ndim - 1)}
        return output.ndim in (4, 5) and not pairs.isdisjoint(sides)

    def decode(self, outputs: Sequence[Output], input_px: tuple[int, int], threshold: float) -> Candidates:
        """Return the rows' best classes whose score reaches the threshold; see Layout."""
        rows, first = self.rows(outputs[0][0]), self._first_class()
        class_scores = rows[:, first:]
        ids = class_scores.argmax(1)
        scores = np.asarray(class_scores[np.arange(len(rows)), ids], np.float64)
        if self.objectness:
            scores = scores * rows[:, 4]
        likely = np.flatnonzero(scores >= threshold)
        boxes = self.boxes(np.asarray(rows[likely, :4], np.float64), likely, input_px)
        half = 0.5 * boxes[:, 2:]
        corners = np.concatenate([boxes[:, :2] - half, boxes[:, :2] + half], axis=1)
        return Candidates(corners, scores[likely], ids[likely].astype(np.int64))

    def boxes(self, boxes: Array, places: NDArray[np.int64], input_px: tuple[int, int]) -> Array:
        """Return centre and size (K, 4) [px] of the first four columns of the rows numbered `places` (K,)."""
        return boxes

    @classmethod
    def _first_class(cls) -> int:
        return 5 if cls.objectness else 4

    def _scores_are_shares(self, warm_up: WarmUp) -> bool:
        return bool((np.abs(self._warm_up_rows(warm_up)[:, 4:]) <= 1.0 + 1e-3).all())

    def _in_pixels(self, warm_up: WarmUp) -> bool:
        """Decoded sizes are not negative and centres go with the cells; undecoded ones are logarithms and offsets."""
        rows = self._warm_up_rows(warm_up)
        return float((rows[:, 2:4] < 0).mean()) < 0.05 and float(np.abs(rows[:, :2]).max(initial=0.0)) > 16.0

    def _warm_up_rows(self, warm_up: WarmUp) -> Array:
        return np.asarray(self.rows(warm_up.outputs[self.outputs[0]][0]), np.float64)


def cells(input_px: tuple[int, int], strides: Sequence[int]) -> int:
    """Return how many cells an input of (width, height) has over all strides."""
    return sum(math.ceil(input_px[0] / s) * math.ceil(input_px[1] / s) for s in strides)
