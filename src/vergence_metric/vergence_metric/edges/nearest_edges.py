"""Exact nearest-edge distances inside several centre windows at once.

The windows lie inside one another. A point's nearest edge pixel in the largest one is also that of every smaller window
whose border is farther from the point than that edge pixel; only for the few points where it is not the search is done
again inside the window. So a point is searched for about once, not once a window.

The rows of the next edge pixel above and below are found once, in whole columns (`_scan`). They give the vertical
distance g (Meijster, Roerdink and Hesselink 2000), and

    d(x, y)^2 = min over x' of (x - x')^2 + g(x', y)^2.

Only the requested points are evaluated, outwards from x, and each is finished as soon as (x - x')^2 alone exceeds its
minimum so far: as edge pixels mostly have a neighbour within a few pixels, the work is a few gathers a point.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.scratch import Scratch
from vergence_metric.edges.windows import Window, hull

LEFT_TO_RIGHT, RIGHT_TO_LEFT = 0, 1
"""Directions: from left pixels to the nearest right edge, and back."""

_LARGEST_SHORT_SIDE = 8192
_BLOCK = 8192  # points looked at at once, and gathers made at once when few are left: fits the second-level cache
_COLUMNS = 3  # columns tried on each side between two checks of what is finished

_ENDLESS = 2**15  # its square fits int32

Indices = NDArray[np.intp]


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
        scratch = scratch or Scratch()
        self.windows = tuple(windows)
        area = hull(self.windows)
        # row 0 is the image that distances are measured from in LEFT_TO_RIGHT, row 1 in RIGHT_TO_LEFT
        self._edges = np.stack([left_mask[area.slices], right_mask[area.slices]]) != 0
        self._above, self._below, self._far = _scan(self._edges[::-1], scratch)
        self._squares = _squared_vertical(self._above, self._below, scratch)

    @property
    def unreachable_px2(self) -> int:
        """Squared distances of this and more mean that there is no edge pixel."""
        return int(self._far) ** 2

    def from_edges(self) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        """Return, for each window, the squared distances [px^2] from the left edge pixels in it and from the right."""
        height, width = self._edges.shape[1:]
        at = np.flatnonzero(self._edges)
        line, column = np.divmod(at, width)
        row = line % height
        squares = self._anywhere(at, line)
        margin = self._margin(row, column)
        open_ = np.flatnonzero((margin > 0) & (squares >= np.square(margin, dtype=squares.dtype)))
        window, point = np.divmod(open_, max(len(at), 1))
        inside = np.tile(squares, (len(self.windows), 1))
        inside[window, point] = self._confined(at[point], row[point], window)
        of_left = np.searchsorted(at, height * width)
        return [
            (found[:of_left][near[:of_left] > 0], found[of_left:][near[of_left:] > 0])
            for found, near in zip(inside, margin, strict=True)
        ]

    def from_lattice(self, points_per_side: int) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        """Return, for each window, the squared distances [px^2] from pixels that lie evenly in it, both directions."""
        lattice = _lattice(self.windows, points_per_side)
        above, below = self._above.take(lattice.row, axis=1), self._below.take(lattice.row, axis=1)
        here, first, end = (v[:, None].astype(above.dtype) for v in (lattice.row, lattice.top, lattice.bottom))
        squares = _squared_cut(above, below, here, first, end, self._far).ravel()
        found = _search(lambda index, _: squares.take(index), lattice.index, lattice.row_start, lattice.row_end)
        parts = np.split(found.reshape(2, -1), lattice.ends, axis=1)
        return [(part[LEFT_TO_RIGHT], part[RIGHT_TO_LEFT]) for part in parts]

    def _anywhere(self, at: Indices, line: Indices) -> NDArray[Any]:
        """Return the squared distance from each place to the nearest edge pixel of the largest window."""
        width, squares = self._edges.shape[2], self._squares.ravel()
        if not self._edges.any(axis=(1, 2)).all():
            return squares.take(at)  # one image has no edge pixels
        start = line * width
        return _search(lambda index, _: squares.take(index), at, start, start + (width - 1))

    def _margin(self, row: Indices, column: Indices) -> NDArray[np.int32]:
        """Return how far it is from each place to the nearest pixel outside each window, 0 for one outside it."""
        rows, columns = _margins(self.windows)
        return np.minimum(rows.take(row, axis=1), columns.take(column, axis=1))

    def _confined(self, at: Indices, row: Indices, window: Indices) -> NDArray[Any]:
        """Return the squared distance from each place to the nearest edge pixel of the window of that index."""
        top, left, bottom, right = _borders(self.windows)[window].T
        start = at - at % self._edges.shape[2]
        above, below, far = self._above.ravel(), self._below.ravel(), self._far
        here, first, end = (values.astype(above.dtype) for values in (row, top, bottom))

        def vertical(index: Indices, of: Indices) -> NDArray[Any]:
            return _squared_cut(above.take(index), below.take(index), here[of], first[of], end[of], far)

        return _search(vertical, at, start + left, start + right - 1)


@lru_cache(maxsize=8)
def _borders(windows: tuple[Window, ...]) -> Indices:
    """Return top, left, bottom and right of each window, from the corner of the largest, (windows, 4)."""
    area = hull(windows)
    borders = [(w.top - area.top, w.left - area.left, w.bottom - area.top, w.right - area.left) for w in windows]
    return np.array(borders, np.intp).reshape(-1, 4)


@lru_cache(maxsize=8)
def _margins(windows: tuple[Window, ...]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return how far each row, and each column, is inside each window: (windows, rows), (windows, columns).

    For windows as large as the largest one it is practically infinite: nothing outside is searched.
    """
    area = hull(windows)
    top, left, bottom, right = _borders(windows).T[:, :, None]
    row, column = np.arange(area.height), np.arange(area.width)
    margins = (
        np.maximum(np.minimum(row - top + 1, bottom - row), 0),
        np.maximum(np.minimum(column - left + 1, right - column), 0),
    )
    whole = [(w.height, w.width) == (area.height, area.width) for w in windows]
    for margin in margins:
        margin[whole] = _ENDLESS
    return margins[0].astype(np.int32), margins[1].astype(np.int32)


@dataclass(frozen=True)
class _Lattice:
    """Pixels that lie evenly in each window, by the rows (k,) of the largest window that they lie in.

    Each row has the `top` and `bottom` of its window. `index`, `row_start`, `row_end` (n,) are places in a (2, k, w)
    array of those rows, for both directions; `ends` are the ends of all windows but the last in one direction.
    """

    row: Indices
    top: Indices
    bottom: Indices
    index: Indices
    row_start: Indices
    row_end: Indices
    ends: Indices


@lru_cache(maxsize=8)
def _lattice(windows: tuple[Window, ...], points_per_side: int) -> _Lattice:
    width, lines, places, sizes = hull(windows).width, list[tuple[int, int, int]](), [], []
    for window, (top, left, bottom, right) in zip(windows, _borders(windows), strict=True):
        rows, columns = window.lattice(points_per_side)
        start = (len(lines) + np.arange(len(rows)))[:, None] * width
        lines += [(top + row, top, bottom) for row in rows]
        places.append(np.stack(np.broadcast_arrays(start + left + columns, start + left, start + right - 1)))
        sizes.append(rows.size * columns.size)
    row, top, bottom = np.array(lines, np.intp).reshape(-1, 3).T
    of_one = np.concatenate([place.reshape(3, -1) for place in places], axis=1)
    index, row_start, row_end = np.concatenate([of_one, of_one + len(lines) * width], axis=1)
    return _Lattice(row, top, bottom, index, row_start, row_end, np.cumsum(sizes)[:-1])


def _scan(edges: NDArray[np.bool_], scratch: Scratch) -> tuple[NDArray[Any], NDArray[Any], int]:
    """Return the row of the last edge at or above and of the first at or below each pixel, and a far distance.

    `edges` (2, h, w). Rows without such an edge hold -far and 2 * far.
    """
    height = edges.shape[1]
    kind, far = (np.int16, 12000) if max(edges.shape) <= _LARGEST_SHORT_SIDE else (np.int32, 2**28)
    row = np.arange(height, dtype=kind)[:, None]
    above, below, spare = (scratch.array(name, edges.shape, kind) for name in ("above", "below", "spare"))
    above.fill(-far)
    below.fill(2 * far)
    np.copyto(above, row, where=edges)
    np.copyto(below, row, where=edges)
    step = 1
    while step < height:  # each round doubles the number of rows covered
        np.maximum(above[:, step:], above[:, :-step], out=spare[:, step:])
        spare[:, :step] = above[:, :step]
        above, spare = spare, above
        np.minimum(below[:, :-step], below[:, step:], out=spare[:, :-step])
        spare[:, -step:] = below[:, -step:]
        below, spare = spare, below
        step *= 2
    return above, below, far


def _squared_vertical(above: NDArray[Any], below: NDArray[Any], scratch: Scratch) -> NDArray[Any]:
    """Return g^2 of every pixel, (2, h, w)."""
    kind = np.int32 if above.dtype == np.int16 else np.int64
    row = np.arange(above.shape[1], dtype=above.dtype)[:, None]
    nearest = np.minimum(row - above, below - row)
    return np.multiply(nearest, nearest, out=scratch.array("vertical", above.shape, kind), dtype=kind)


def _squared_cut(
    above: NDArray[Any], below: NDArray[Any], row: NDArray[Any], top: NDArray[Any], bottom: NDArray[Any], far: int
) -> NDArray[Any]:
    """Return g^2 of pixels in `row`, where only the rows from `top` to `bottom`, half open, count."""
    nearest = np.where(above >= top, row - above, far)
    np.minimum(nearest, np.where(below < bottom, below - row, far), out=nearest)
    return np.square(nearest, dtype=np.int32 if above.dtype == np.int16 else np.int64)


def _search(
    vertical: Callable[[Indices, Indices], NDArray[Any]], index: Indices, row_start: Indices, row_end: Indices
) -> NDArray[Any]:
    """Return min over x' of (x - x')^2 + vertical(x') for points `index` in rows from `row_start` to `row_end`.

    `vertical` is called with places and the indices of the points that ask for them. Steps that would leave the row are
    clamped to its end, which overestimates the distance and never underestimates it.
    """
    active = np.arange(len(index))
    nearest = vertical(index, active)
    if not len(index):
        return nearest
    widest = int((row_end - row_start).max())
    best, step = nearest, 1
    while len(active) and step <= widest:
        columns = min(max(_COLUMNS, _BLOCK // len(active)), widest - step + 1)
        offsets = np.arange(step, step + columns)[:, None]
        squares = (offsets * offsets).astype(nearest.dtype)
        for start in range(0, len(active), _BLOCK):
            some = slice(start, start + _BLOCK)
            found = vertical(np.minimum(index[some] + offsets, row_end[some]), active[some])
            np.minimum(found, vertical(np.maximum(index[some] - offsets, row_start[some]), active[some]), out=found)
            found += squares
            np.minimum(best[some], found.min(axis=0), out=best[some])
        step += columns
        nearest[active] = best
        unfinished = np.flatnonzero(best > step * step)
        active, best = active[unfinished], best[unfinished]
        index, row_start, row_end = index[unfinished], row_start[unfinished], row_end[unfinished]
    return nearest
