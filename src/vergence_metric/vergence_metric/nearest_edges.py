"""Exact nearest-edge distances inside several centre windows at once.

A distance transform is no help here: that of a large window is wrong for a smaller one inside it, whose edge pixels may
have their neighbour outside, and six precise transforms cost as much as six KD-trees. Instead the distances to the next
edge pixel above and below are found once, in whole columns (`_scan`); cut at a window's rows they give, without another
scan, the window's vertical distance g (Meijster, Roerdink and Hesselink 2000), and

    d(x, y)^2 = min over x' in the window of (x - x')^2 + g(x', y)^2.

Only the points asked for are evaluated, outwards from x, and each is dropped as soon as (x - x')^2 alone is larger than
what it has: as edge pixels mostly have a neighbour within a few pixels, the work is a few gathers a point.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.scratch import Scratch
from vergence_metric.windows import Window

LEFT_TO_RIGHT, RIGHT_TO_LEFT = 0, 1
"""Directions: from left pixels to the nearest right edge, and back."""

_LARGEST_SHORT_SIDE = 8192
_BLOCK = 8192  # points looked at at once, and gathers made at once when few are left: fits the second-level cache
_COLUMNS = 3  # columns tried on each side between two checks of what is finished


class NearestEdges:
    """Squared distances to the nearest edge pixel of the other image, inside each window and in both directions.

    `left_mask`, `right_mask` (h, w) uint8 are nonzero at edge pixels; `windows` are centre windows of that image.
    With `scratch` the memory is taken from there: this object is then good until the next one made with it.
    """

    def __init__(
        self,
        left_mask: NDArray[np.uint8],
        right_mask: NDArray[np.uint8],
        windows: Sequence[Window],
        scratch: Scratch | None = None,
    ) -> None:
        self._scratch = scratch or Scratch()
        self.windows = tuple(windows)
        hull = _hull(self.windows)
        # row 0 is the image that distances are measured from in LEFT_TO_RIGHT, row 1 in RIGHT_TO_LEFT
        self._edges = np.stack([left_mask[hull.slices], right_mask[hull.slices]]) != 0
        self._inside = [
            (slice(w.top - hull.top, w.bottom - hull.top), slice(w.left - hull.left, w.right - hull.left))
            for w in self.windows
        ]
        areas = np.array([w.height * w.width for w in self.windows], np.int64)
        self._starts = np.concatenate([[0], np.cumsum(np.tile(areas, 2))])
        self._vertical = self._squared_vertical()

    def edge_points(self, direction: int, window: int) -> NDArray[np.int64]:
        """Return the flat indices, within the window, of the edge pixels that distances start from."""
        rows, columns = self._inside[window]
        return np.flatnonzero(self._edges[direction, rows, columns])

    def reachable(self, direction: int, window: int) -> bool:
        """Tell whether the other image has an edge pixel in that window."""
        rows, columns = self._inside[window]
        return bool(self._edges[1 - direction, rows, columns].any())

    def squared_distances(self, points: Sequence[NDArray[np.int64]]) -> list[NDArray[Any]]:
        """Return the squared distance [px^2] from each point to the nearest edge pixel of the other image.

        `points` holds flat indices within the window, one array for every window from left to right, then one for every
        window from right to left; the answer has the same order. Distances in a window where the other image has no
        edge pixel are larger than any real one.
        """
        n = len(self.windows)
        widths = [self.windows[i % n].width for i in range(2 * n)]
        blocks = list(zip(points, widths, self._starts[:-1], strict=True))
        index = np.concatenate([flat + start for flat, _, start in blocks])
        row_start = np.concatenate([flat - flat % width + start for flat, width, start in blocks])
        row_end = row_start + np.repeat(np.array(widths, np.int64) - 1, [len(p) for p in points])
        squares = _search(self._vertical, index, row_start, row_end)
        return np.split(squares, np.cumsum([len(p) for p in points[:-1]]))

    def _squared_vertical(self) -> NDArray[Any]:
        """Return g^2 of every pixel of every window, both directions, one after the other."""
        above, below, far = _scan(self._edges[::-1], self._scratch)
        kind: type[np.signedinteger[Any]] = np.int32 if above.dtype == np.int16 else np.int64
        squares = self._scratch.array("vertical", (int(self._starts[-1]),), kind)
        n = len(self.windows)
        for i, (rows, columns) in enumerate(self._inside):
            row = np.arange(rows.start, rows.stop, dtype=above.dtype)[:, None]
            up, down = above[:, rows, columns], below[:, rows, columns]
            distance = np.minimum(
                np.where(up >= rows.start, row - up, far), np.where(down < rows.stop, down - row, far)
            )
            for direction in (LEFT_TO_RIGHT, RIGHT_TO_LEFT):
                block = i + direction * n
                out = squares[self._starts[block] : self._starts[block + 1]].reshape(distance.shape[1:])
                np.multiply(distance[direction], distance[direction], out=out, dtype=kind)
        return squares


def _hull(windows: Sequence[Window]) -> Window:
    return Window(
        max((w.size_px for w in windows), default=0),
        min((w.top for w in windows), default=0),
        min((w.left for w in windows), default=0),
        max((w.bottom for w in windows), default=0),
        max((w.right for w in windows), default=0),
    )


def _scan(edges: NDArray[np.bool_], scratch: Scratch) -> tuple[NDArray[Any], NDArray[Any], int]:
    """Return the row of the last edge at or above and of the first at or below each pixel, and a far distance.

    `edges` (2, h, w). Rows without such an edge hold -far and 2 * far.
    """
    height = edges.shape[1]
    kind, far = (np.int16, 16000) if max(edges.shape) <= _LARGEST_SHORT_SIDE else (np.int32, 2**28)
    row = np.arange(height, dtype=kind)[:, None]
    above, below, spare = (scratch.array(name, edges.shape, kind) for name in ("above", "below", "spare"))
    above.fill(-far)
    below.fill(2 * far)
    np.copyto(above, row, where=edges)
    np.copyto(below, row, where=edges)
    step = 1
    while step < height:  # after each round a pixel knows the edges within twice as many rows
        np.maximum(above[:, step:], above[:, :-step], out=spare[:, step:])
        spare[:, :step] = above[:, :step]
        above, spare = spare, above
        np.minimum(below[:, :-step], below[:, step:], out=spare[:, :-step])
        spare[:, -step:] = below[:, -step:]
        below, spare = spare, below
        step *= 2
    return above, below, far


def _search(
    vertical: NDArray[Any], index: NDArray[np.int64], row_start: NDArray[np.int64], row_end: NDArray[np.int64]
) -> NDArray[Any]:
    """Return min over x' of (x - x')^2 + vertical(x'), for points `index` in rows from `row_start` to `row_end`.

    Steps that would leave the row are held at its end: too far by their own reckoning, so never below the truth.
    """
    nearest = vertical[index]
    if not len(index):
        return nearest
    widest = int((row_end - row_start).max())
    best, active, step = nearest, np.arange(len(index)), 1
    while len(active) and step <= widest:
        columns = min(max(_COLUMNS, _BLOCK // len(active)), widest - step + 1)
        offsets = np.arange(step, step + columns)[:, None]
        squares = (offsets * offsets).astype(vertical.dtype)
        for start in range(0, len(active), _BLOCK):
            some = slice(start, start + _BLOCK)
            found = vertical[np.minimum(index[some] + offsets, row_end[some])]
            np.minimum(found, vertical[np.maximum(index[some] - offsets, row_start[some])], out=found)
            found += squares
            np.minimum(best[some], found.min(axis=0), out=best[some])
        step += columns
        nearest[active] = best
        unfinished = np.flatnonzero(best > step * step)
        active, best = active[unfinished], best[unfinished]
        index, row_start, row_end = index[unfinished], row_start[unfinished], row_end[unfinished]
    return nearest
