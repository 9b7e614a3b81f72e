"""Base of the layouts with one or more rows for every cell of the strides' grids."""

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.layouts.protocol import Array, Candidates, Layout, Output, WarmUp

_SCORE_TOLERANCE = 1e-3
_IN_PIXELS = 0.5
_MOST_NEGATIVE = 0.25  # of the sizes; a trained network without objects in view may have a few

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

    def contradiction(self, warm_up: WarmUp) -> str:
        """See Layout: scores must be shares, and boxes centres and sizes in pixels."""
        return self._scores_contradiction(warm_up) or self._pixels_contradiction(warm_up)

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

    def _scores_contradiction(self, warm_up: WarmUp) -> str:
        scores = self._warm_up_rows(warm_up)[:, 4:]
        low, high = float(scores.min()), float(scores.max())
        if low < -_SCORE_TOLERANCE or high > 1.0 + _SCORE_TOLERANCE:
            return f"its scores must be 0 to 1: got {low:.3g} to {high:.3g}"
        return ""

    def _pixels_contradiction(self, warm_up: WarmUp) -> str:
        negative = float((self._warm_up_rows(warm_up)[:, 2:4] < 0.0).mean())
        if negative > _MOST_NEGATIVE:
            return f"its widths and heights must not be negative: {negative:.0%} of them are"
        slope = self.grid_slope(warm_up)
        if not slope > _IN_PIXELS:
            return f"the centres of its boxes must be in pixels: from cell to cell they change by {slope:.2g} cells"
        return ""

    def grid_slope(self, warm_up: WarmUp) -> float:
        """Return by how many cells boxes' centres change from cell to cell: 1 if they are in pixels, 0 for offsets.

        The lesser of the least-squares slopes of x over the cells' x and of y over their y, summed over the whole grid.
        """
        centres = np.concatenate(
            [np.tile(cell_centres(warm_up.input_px, stride), (self.rows_per_cell, 1)) for stride in self.strides]
        )
        centres -= centres.mean(0)
        spread = (centres**2).sum(0)
        if not spread.all():
            return math.nan
        return float(((centres * self._warm_up_rows(warm_up)[:, :2]).sum(0) / spread).min())

    def _warm_up_rows(self, warm_up: WarmUp) -> Array:
        return np.asarray(self.rows(warm_up.outputs[self.outputs[0]][0]), np.float64)


def cell_centres(input_px: tuple[int, int], stride: int) -> Array:
    """Return the centres (N, 2) [px] of one stride's cells, row by row, of an input of (width, height)."""
    columns, rows = math.ceil(input_px[0] / stride), math.ceil(input_px[1] / stride)
    y, x = np.mgrid[0:rows, 0:columns]
    return (np.column_stack([x.ravel(), y.ravel()]) + 0.5) * stride


def cells(input_px: tuple[int, int], strides: Sequence[int]) -> int:
    """Return how many cells an input of (width, height) has over all strides."""
    return sum(math.ceil(input_px[0] / s) * math.ceil(input_px[1] / s) for s in strides)


def objectness_is_one(rows: Array) -> bool:
    """Return whether the objectness, column 4 of rows (N, columns), is 1 throughout."""
    return bool((np.abs(rows[:, 4] - 1.0) < _SCORE_TOLERANCE).all())
