"""Which box of the right eye is the same object as which of the left: not the best score in each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.appearance import likeness, signature
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.pair_geometry import PairGeometry, Pixel
from vergence_metric.boxes.parameters import BoxMetricParameters

_SIZE_SIGMA = 0.12
_SIZE_FLOOR_PX = 2.0
_UNLIKE_SIGMA = 0.2
_SCORE_SIGMA = 0.5
_MOVED_SIGMA_PX = 12.0
_DIVERGING_PX = 12.0  # servos without feedback are off by about as much


@dataclass(frozen=True)
class BoxPair:
    """One object's boxes in both eyes, and what speaks against it: squared deviations, summed; 0 is a perfect fit.

    `ambiguous` says that another pairing of one of the boxes fits about as well.
    """

    left: Box
    right: Box
    cost: float
    ambiguous: bool


@dataclass(frozen=True)
class Expected:
    """Where an object of a class should be seen by each eye, by what was seen before; None where that is unknown."""

    class_id: int
    left_px: Pixel | None
    right_px: Pixel | None


@dataclass(frozen=True)
class Association:
    """The pairs, best fit first, and the boxes that have no partner."""

    pairs: tuple[BoxPair, ...]
    left_only: tuple[Box, ...]
    right_only: tuple[Box, ...]


def associate(
    left: Sequence[Box],
    right: Sequence[Box],
    parameters: BoxMetricParameters,
    vertical_px: float = 0.0,
    images: tuple[NDArray[Any], NDArray[Any]] | None = None,
    geometry: PairGeometry | None = None,
    expected: Expected | None = None,
) -> Association:
    """Pair the boxes of two images so that all of them together fit best.

    Args:
        left: objects of the left image.
        right: objects of the right one.
        parameters: gates and margins.
        vertical_px: y_left - y_right that the mounts give every object.
        images: both images, to compare what the boxes hold; None compares places and sizes only.
        geometry: where the other eye can see what one eye sees; None takes rows for epipolar lines.
        expected: where the target was, None if that is not known.

    """
    signatures: tuple[list[Any], list[Any]] = ([None] * len(left), [None] * len(right))
    if images is not None:
        signatures = ([signature(images[0], box) for box in left], [signature(images[1], box) for box in right])
    costs = np.full((len(left), len(right)), math.inf)
    for i, a in enumerate(left):
        for j, b in enumerate(right):
            cost = _cost(a, b, parameters, vertical_px, geometry)
            if math.isfinite(cost):
                cost += _discontinuity(a, b, expected, parameters.follow_gate_px)
                alike = likeness(signatures[0][i], signatures[1][j])
                cost += 0.0 if alike is None else ((1.0 - alike) / _UNLIKE_SIGMA) ** 2
                # Where each eye misses one of two alike things, what is left is no pair.
                costs[i, j] = cost if cost <= parameters.pair_misfit else math.inf
    chosen = _best_together(costs)
    pairs = []
    for i, j in chosen:
        rivals = np.concatenate([np.delete(costs[i], j), np.delete(costs[:, j], i)])
        nearest = float(rivals.min(initial=math.inf))
        pairs.append(BoxPair(left[i], right[j], float(costs[i, j]), nearest - costs[i, j] < parameters.pair_margin))
    pairs.sort(key=lambda pair: pair.cost)
    taken_left, taken_right = {i for i, _ in chosen}, {j for _, j in chosen}
    return Association(
        tuple(pairs),
        tuple(box for i, box in enumerate(left) if i not in taken_left),
        tuple(box for j, box in enumerate(right) if j not in taken_right),
    )


def _cost(a: Box, b: Box, p: BoxMetricParameters, vertical_px: float, geometry: PairGeometry | None) -> float:
    """Return the squared deviations of two boxes from being one object's; inf where they cannot be."""
    if a.class_id != b.class_id:
        return math.inf
    horizontal = a.center_px[0] - b.center_px[0]
    if abs(horizontal) > p.pair_disparity_px:
        return math.inf
    if geometry is not None:
        # Nothing lies beyond infinity.
        if horizontal < geometry.parallel_px(a.center_px) - _DIVERGING_PX:
            return math.inf
        vertical_px += geometry.vertical_px(a.center_px, b.center_px[0])
    vertical = _vertical_misfit(a, b, vertical_px)
    if abs(vertical) > p.pair_vertical_px:
        return math.inf
    cost = (3.0 * vertical / p.pair_vertical_px) ** 2
    for side in (0, 1):
        # A border shortens a box along its own direction only.
        if a.cut[side] or a.cut[side + 2] or b.cut[side] or b.cut[side + 2]:
            continue
        sizes = a.size_px[side], b.size_px[side]
        stretch = abs(math.log(max(sizes[0], 1e-3) / max(sizes[1], 1e-3)))
        # Widths of one object differ with where it is seen from, and where it is hidden: heights gate alone.
        if side == 1 and stretch > math.log(p.pair_size_ratio):
            return math.inf
        sigma = math.hypot(_SIZE_SIGMA * (2.0 - side), _SIZE_FLOOR_PX / min(sizes))
        cost += min((stretch / sigma) ** 2, 9.0)
    return cost + ((a.score - b.score) / _SCORE_SIGMA) ** 2


def _discontinuity(a: Box, b: Box, expected: Expected | None, gate_px: float) -> float:
    """Return the squared deviation from having moved alike in both eyes, for boxes where the target was."""
    if expected is None or expected.left_px is None or expected.right_px is None or a.class_id != expected.class_id:
        return 0.0
    moved = np.subtract(a.center_px, expected.left_px), np.subtract(b.center_px, expected.right_px)
    if min(float(np.hypot(*m)) for m in moved) > gate_px:
        return 0.0
    return min((float(np.hypot(*(moved[0] - moved[1]))) / _MOVED_SIGMA_PX) ** 2, 9.0)


def _vertical_misfit(a: Box, b: Box, vertical_px: float) -> float:
    """Return how far the rows disagree, by the sides that no border cuts."""
    sides = [s for s in (1, 3) if not a.cut[s] and not b.cut[s]]
    if not sides:
        return 0.0
    return float(np.mean([a.xyxy_px[s] - b.xyxy_px[s] for s in sides])) - vertical_px


def _best_together(costs: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Return the pairing with the most pairs, and of those the least sum (Kuhn 1955, by shortest augmenting paths)."""
    rows, columns = costs.shape
    if rows == 0 or columns == 0:
        return []
    finite = costs[np.isfinite(costs)]
    if not finite.size:
        return []
    # Staying alone costs more than any pairing could gain, so that as many as possible are paired.
    alone = float(finite.max()) * min(rows, columns) + 1.0
    side = max(rows, columns)
    square = np.full((side, side), alone)
    square[:rows, :columns] = np.where(np.isfinite(costs), costs, alone)
    u, v = np.zeros(side + 1), np.zeros(side + 1)
    match = np.zeros(side + 1, np.int64)
    for row in range(1, side + 1):
        match[0], column = row, 0
        least, used = np.full(side + 1, math.inf), np.zeros(side + 1, bool)
        before = np.zeros(side + 1, np.int64)
        while True:
            used[column] = True
            reduced = square[match[column] - 1] - u[match[column]] - v[1:]
            better = ~used[1:] & (reduced < least[1:])
            least[1:][better], before[1:][better] = reduced[better], column
            following = int(np.where(used[1:], math.inf, least[1:]).argmin()) + 1
            step = least[following]
            u[match[used]] += step
            v[used] -= step
            least[~used] -= step
            column = following
            if match[column] == 0:
                break
        while column:
            match[column], column = match[before[column]], int(before[column])
    return [
        (int(match[j]) - 1, j - 1)
        for j in range(1, columns + 1)
        if match[j] - 1 < rows and math.isfinite(costs[match[j] - 1, j - 1])
    ]
