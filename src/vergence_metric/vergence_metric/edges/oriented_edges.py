"""Edge pixels by gradient direction, and truncated distances to those of one direction.

The nearest edge pixel of the other image belongs to the same surface only if its edge has the same direction. Edge
pixels are therefore sorted into bins by the direction of their gradient, and distances are taken within a bin and cut
off where the nearest one is too far to be of the same edge.

Up to eight bins share the bits of one byte a pixel. With distances cut off at a few pixels there are few different
ones: plane i of `OrientedEdges.planes` has a bin's bit set where an edge pixel of that bin lies within the i-th one.
Each plane is the one before with a few shifted copies of the edges laid over it, for all bins at once.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.edges import Edges
from vergence_metric.edges.parameters import MAX_BINS, MAX_TRUNCATION_PX
from vergence_metric.edges.scratch import Scratch
from vergence_metric.edges.windows import Window

Buffer = Callable[[tuple[int, ...], type[np.uint8]], NDArray[np.uint8]]


@dataclass(frozen=True)
class OrientedEdges:
    """Edge pixels of one image inside the largest window, and the neighbourhood of every pixel.

    `bin` (n,) uint8 is the direction, `ring` (n,) the index of the smallest window that holds the pixel, windows sorted
    by size. `planes` (radii, pixels) uint8 are the planes the module describes, `at` (n,) the edge pixels' places in
    them. The planes reach `margin` pixels beyond the largest window and are `stride` pixels wide.
    """

    bin: NDArray[np.uint8]
    ring: NDArray[np.int64]
    at: NDArray[np.int64]
    planes: NDArray[np.uint8]
    margin: int
    stride: int

    @property
    def places(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns (n,) of the edge pixels from the corner of the largest window."""
        row, column = np.divmod(self.at, self.stride)
        return row - self.margin, column - self.margin


@dataclass(frozen=True)
class OrientedField:
    """Oriented edges of the left and the right image in centre windows, which are sorted by size."""

    windows: tuple[Window, ...]
    bins: int
    truncation_px: int
    images: tuple[OrientedEdges, OrientedEdges]
    _cache: dict[tuple[object, ...], NDArray[Any]] = field(default_factory=dict, repr=False, compare=False)

    def distances_px(self, direction: int, truncation_px: int) -> NDArray[np.float32]:
        """Return the truncated distance of each edge pixel of image `direction` to the other's of its bin, (n,)."""
        key = ("at edges", direction, truncation_px)
        if key not in self._cache:
            edges, planes = self.images[direction], self.images[1 - direction].planes
            steps = radius_steps(truncation_px)
            near = np.take(planes[: len(steps)], edges.at, axis=1)
            near >>= edges.bin
            near &= 1
            self._cache[key] = np.float32(truncation_px) - steps @ near.astype(np.float32)
        return self._cache[key]

    def mean_distances_px(self, image: int, truncation_px: int, points_per_side: int) -> NDArray[np.float64]:
        """Return the mean truncated distance to the edges of `image`, (windows, bins), over a lattice of pixels."""
        key = ("everywhere", image, truncation_px, points_per_side)
        if key not in self._cache:
            self._cache[key] = self._mean_distances(image, truncation_px, points_per_side)
        return self._cache[key]

    def fovea_weights(self, image: int, sigma_px: float) -> NDArray[np.float64]:
        """Return a Gaussian weight of each edge pixel of `image` about the windows' centre, (n,)."""
        window, (row, column) = self.windows[-1], self.images[image].places
        return _gaussian(window.height, sigma_px)[row] * _gaussian(window.width, sigma_px)[column]

    def _mean_distances(self, image: int, truncation_px: int, points_per_side: int) -> NDArray[np.float64]:
        planes, places = self.images[image].planes, _lattice(self.windows, self.truncation_px, points_per_side)
        steps = radius_steps(truncation_px).astype(np.float64)
        near = planes[: len(steps)].take(places.index, axis=1)
        # a bit becomes a byte of its own, so that one addition of words adds up all bins of a row's pixels
        of_rows = np.add.reduceat(_SPREAD.take(near), places.row_starts, axis=1).view(np.uint8)
        counts = np.add.reduceat(
            of_rows.reshape(len(steps), -1, MAX_BINS), places.window_starts, axis=1, dtype=np.int64
        )[..., : self.bins]
        return truncation_px - np.tensordot(steps, counts, axes=1) / places.sizes[:, None]


@dataclass(frozen=True)
class _Lattice:
    """Places in a plane of pixels that lie evenly in each window.

    `row_starts` says where in `index` a row of pixels begins, `window_starts` which of the rows begins a window, and
    `sizes` how many pixels a window has.
    """

    index: NDArray[np.intp]
    row_starts: NDArray[np.intp]
    window_starts: NDArray[np.intp]
    sizes: NDArray[np.intp]


@lru_cache(maxsize=16)
def _lattice(windows: tuple[Window, ...], margin: int, points_per_side: int) -> _Lattice:
    outer, rows_of, sizes, places = windows[-1], [0], [], []
    for window in windows:
        row, column = window.lattice(points_per_side)
        row += window.top - outer.top + margin
        column += window.left - outer.left + margin
        places += list(row[:, None] * (outer.width + 2 * margin) + column)
        rows_of.append(len(places))
        sizes.append(row.size * column.size)
    row_starts = np.cumsum([0, *(len(row) for row in places[:-1])])
    return _Lattice(np.concatenate(places), row_starts, np.array(rows_of[:-1]), np.array(sizes))


_SPREAD = np.unpackbits(np.arange(256, dtype=np.uint8)[:, None], axis=1, bitorder="little").view(np.uint64).ravel()


def oriented_field(
    left: Edges | OrientedEdges,
    right: Edges,
    windows: Sequence[Window],
    *,
    bins: int,
    signed: bool,
    truncation_px: int,
    scratch: Scratch | None = None,
) -> OrientedField:
    """Return the oriented edges of a pair, with distances up to `truncation_px`.

    `bins` directions over 360 degrees with `signed`, which distinguishes dark-to-bright from bright-to-dark, else over
    180; the first is centred on horizontal gradients. Neighbours may lie outside a window: unlike
    the paper's metric this one only reaches `truncation_px`, and edges cut off by a window's border would add noise.
    With `scratch` the memory is taken from there: the field is then good until the next one made with it. `left` may
    be that of another field with the same windows, bins and cut-off.
    """
    if not 1 <= truncation_px <= MAX_TRUNCATION_PX or not 1 <= bins <= MAX_BINS:
        raise ValueError(
            f"truncation_px must be 1 to {MAX_TRUNCATION_PX}, bins 1 to {MAX_BINS}: got {truncation_px} and {bins}"
        )
    ordered = tuple(sorted(windows, key=lambda window: window.size_px))
    scratch = scratch or Scratch()
    images = [
        edges
        if isinstance(edges, OrientedEdges)
        else _oriented(edges, ordered, bins, signed, truncation_px, partial(scratch.array, name))
        for edges, name in ((left, "left planes"), (right, "right planes"))
    ]
    return OrientedField(ordered, bins, truncation_px, (images[0], images[1]))


@cache
def radius_steps(truncation_px: int) -> NDArray[np.float32]:
    """Return what each plane's bit takes off the cut-off distance: from its radius to the next larger one [px]."""
    radii = np.sqrt([*_offsets(truncation_px), truncation_px**2])
    return np.diff(radii).astype(np.float32)


@cache
def _offsets(truncation_px: int) -> dict[int, tuple[tuple[int, int], ...]]:
    """Return, by squared distance below the cut-off, the (dx, dy) >= 0 that have it, in rising order."""
    reach = range(truncation_px)
    pairs = [(dx, dy) for dx in reach for dy in reach if dx * dx + dy * dy < truncation_px**2]
    squares = sorted({dx * dx + dy * dy for dx, dy in pairs})
    return {s: tuple((dx, dy) for dx, dy in pairs if dx * dx + dy * dy == s) for s in squares}


def _gaussian(length: int, sigma: float) -> NDArray[np.float64]:
    return np.exp(-0.5 * ((np.arange(length) - (length - 1) / 2.0) / sigma) ** 2)


def _oriented(
    edges: Edges, windows: tuple[Window, ...], bins: int, signed: bool, truncation: int, buffer: Buffer
) -> OrientedEdges:
    inner = windows[-1]
    rows, columns = (
        slice(inner.top - truncation, inner.bottom + truncation),
        slice(inner.left - truncation, inner.right + truncation),
    )
    mask = _margined(edges.mask, rows, columns)
    at = np.flatnonzero(mask)
    across, down = (_margined(g, rows, columns).ravel()[at] for g in (edges.gradient_x, edges.gradient_y))
    direction = np.arctan2(down, across, dtype=np.float32)
    per_turn = bins if signed else 2 * bins
    bin_ = (np.rint(direction * np.float32(per_turn / (2 * np.pi))).astype(np.int8) % bins).astype(np.uint8)
    base = np.zeros(mask.size, np.uint8)
    base[at] = np.left_shift(np.uint8(1), bin_)
    planes = _planes(base, mask.shape[1], truncation, buffer)
    ring = _rings(windows, truncation)[at]
    inside = np.flatnonzero(ring < len(windows))
    return OrientedEdges(bin_[inside], ring[inside], at[inside], planes, truncation, mask.shape[1])


def _margined(image: NDArray[Any], rows: slice, columns: slice) -> NDArray[Any]:
    """Return image[rows, columns], with zeros where that leaves the image."""
    height, width = image.shape
    inside = image[max(rows.start, 0) : rows.stop, max(columns.start, 0) : columns.stop]
    lacking = (max(-rows.start, 0), max(rows.stop - height, 0)), (max(-columns.start, 0), max(columns.stop - width, 0))
    return np.pad(inside, lacking) if any(map(any, lacking)) else inside


@lru_cache(maxsize=16)
def _rings(windows: tuple[Window, ...], margin: int) -> NDArray[np.int64]:
    """Return which window is the first to hold each pixel of the last one and a margin, laid end to end."""
    outer = windows[-1]
    ring = np.full((outer.height + 2 * margin, outer.width + 2 * margin), len(windows), np.int64)
    for i, window in reversed(list(enumerate(windows))):
        top, left = window.top - outer.top + margin, window.left - outer.left + margin
        ring[top : top + window.height, left : left + window.width] = i
    return ring.ravel()


def _planes(base: NDArray[np.uint8], stride: int, truncation: int, buffer: Buffer) -> NDArray[np.uint8]:
    """Return the planes of all radii below the cut-off; rows are laid end to end, the outer margin is not valid."""
    planes = buffer((len(_offsets(truncation)), base.size), np.uint8)
    margin = (truncation - 1) * stride + truncation
    inner = slice(margin, base.size - margin)
    aside = [base]  # base shifted by dx to both sides
    for dx in range(1, truncation):
        both = np.zeros_like(base)
        np.bitwise_or(base[2 * dx :], base[: -2 * dx], out=both[dx:-dx])
        aside.append(both)
    planes[0] = base
    for i, offsets in enumerate(_offsets(truncation).values()):
        plane, before = planes[i, inner], planes[max(i - 1, 0), inner]
        for dx, dy in offsets:
            for shift in {dy * stride, -dy * stride}:
                np.bitwise_or(before, aside[dx][margin + shift : base.size - margin + shift], out=plane)
                before = plane
    return planes
