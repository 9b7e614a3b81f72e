"""Association: which box of the right image is the same object as which box of the left one."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.assignment import optimal_assignment
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.face_pairing import face_cost
from vergence_metric.boxes.pair_geometry import PairGeometry, Pixel
from vergence_metric.boxes.parameters import AssociationParameters
from vergence_metric.boxes.patch_descriptor import descriptor_correlation, patch_descriptor

# Standard deviations of the differences between one object's two boxes.
_SIZE_SIGMA = 0.12  # of the logarithm of the height
_SIZE_FLOOR_PX = 2.0
_APPEARANCE_SIGMA = 0.2  # of the descriptors' correlation from 1
_FACE_APPEARANCE_SIGMA = 0.12  # of faces, which are brought to one place, turn and size
_SCORE_SIGMA = 0.5
_MOTION_SIGMA_PX = 12.0
_DIVERGENCE_PX = 12.0  # beyond infinity: error of servos without feedback


@dataclass(frozen=True)
class BoxPair:
    """One object's boxes in both eyes. `cost` is the sum of squared deviations, 0 for a perfect fit.

    `ambiguous` is True where another pair that shares a box with it costs about as little.
    """

    left: Box
    right: Box
    cost: float
    ambiguous: bool


@dataclass(frozen=True)
class Expected:
    """Where the target should be in each image, by the pair before; None where that is unknown.

    `gate_px` is the distance within which a box may be the target's.
    """

    class_id: int
    left_px: Pixel | None
    right_px: Pixel | None
    gate_px: float


@dataclass(frozen=True)
class Association:
    """The pairs, least cost first, and the boxes without a partner."""

    pairs: tuple[BoxPair, ...]
    left_only: tuple[Box, ...]
    right_only: tuple[Box, ...]


def associate(
    left: Sequence[Box],
    right: Sequence[Box],
    parameters: AssociationParameters,
    vertical_px: float = 0.0,
    images: tuple[NDArray[Any], NDArray[Any]] | None = None,
    geometry: PairGeometry | None = None,
    expected: Expected | None = None,
) -> Association:
    """Pair the boxes of two images: as many pairs as possible, of those with the least sum of costs.

    Args:
        left: objects of the left image.
        right: objects of the right one.
        parameters: gates and margins.
        vertical_px: y_left - y_right of every object by the cameras' mounts.
        images: both images, to compare what the boxes hold; None compares places and sizes only.
        geometry: epipolar lines and the disparity of infinity; None takes rows for epipolar lines.
        expected: where the target should be, None if that is unknown.

    """
    descriptors: tuple[list[Any], list[Any]] = ([None] * len(left), [None] * len(right))
    if images is not None:
        descriptors = (
            [patch_descriptor(images[0], box) for box in left],
            [patch_descriptor(images[1], box) for box in right],
        )
    costs = np.full((len(left), len(right)), math.inf)
    for i, a in enumerate(left):
        for j, b in enumerate(right):
            cost = _cost(a, b, parameters, vertical_px, geometry)
            if math.isfinite(cost):
                cost += _motion_cost(a, b, expected)
                correlation = descriptor_correlation(descriptors[0][i], descriptors[1][j])
                sigma = _FACE_APPEARANCE_SIGMA if a.landmarks_px and b.landmarks_px else _APPEARANCE_SIGMA
                cost += 0.0 if correlation is None else ((1.0 - correlation) / sigma) ** 2
                # Where each eye misses one of two similar objects, the two that are left must not be paired.
                costs[i, j] = cost if cost <= parameters.max_cost else math.inf
    chosen = optimal_assignment(costs)
    pairs = []
    for i, j in chosen:
        others = np.concatenate([np.delete(costs[i], j), np.delete(costs[:, j], i)])
        second = float(others.min(initial=math.inf))
        pairs.append(BoxPair(left[i], right[j], float(costs[i, j]), second - costs[i, j] < parameters.min_margin))
    pairs.sort(key=lambda pair: pair.cost)
    paired_left, paired_right = {i for i, _ in chosen}, {j for _, j in chosen}
    return Association(
        tuple(pairs),
        tuple(box for i, box in enumerate(left) if i not in paired_left),
        tuple(box for j, box in enumerate(right) if j not in paired_right),
    )


def _cost(a: Box, b: Box, p: AssociationParameters, vertical_px: float, geometry: PairGeometry | None) -> float:
    """Return the sum of squared deviations between two boxes of one object; inf where they cannot be one's."""
    if a.class_id != b.class_id:
        return math.inf
    horizontal = a.center_px[0] - b.center_px[0]
    if abs(horizontal) > p.max_disparity_px:
        return math.inf
    if geometry is not None:
        # No object lies beyond infinity.
        if horizontal < geometry.parallel_px(a.center_px) - _DIVERGENCE_PX:
            return math.inf
        vertical_px += geometry.vertical_px(a.center_px, b.center_px[0])
    vertical = _vertical_difference(a, b, vertical_px)
    if abs(vertical) > p.max_vertical_px:
        return math.inf
    cost = (3.0 * vertical / p.max_vertical_px) ** 2 + ((a.score - b.score) / _SCORE_SIGMA) ** 2
    if a.landmarks_px and b.landmarks_px:
        return cost + face_cost(a, b, geometry)
    for side in (0, 1):
        # A border shortens a box along its own direction only.
        if a.cut[side] or a.cut[side + 2] or b.cut[side] or b.cut[side + 2]:
            continue
        sizes = a.size_px[side], b.size_px[side]
        stretch = abs(math.log(max(sizes[0], 1e-3) / max(sizes[1], 1e-3)))
        # Widths of one object also differ by viewpoint and occlusion: only heights gate.
        if side == 1 and stretch > math.log(p.max_height_ratio):
            return math.inf
        sigma = math.hypot(_SIZE_SIGMA * (2.0 - side), _SIZE_FLOOR_PX / min(sizes))
        cost += min((stretch / sigma) ** 2, 9.0)
    return cost


def _motion_cost(a: Box, b: Box, expected: Expected | None) -> float:
    """Return the squared difference of the boxes' motions since the pair before, for boxes near the target."""
    if expected is None or expected.left_px is None or expected.right_px is None or a.class_id != expected.class_id:
        return 0.0
    moved = np.subtract(a.center_px, expected.left_px), np.subtract(b.center_px, expected.right_px)
    if min(float(np.hypot(*m)) for m in moved) > expected.gate_px:
        return 0.0
    return min((float(np.hypot(*(moved[0] - moved[1]))) / _MOTION_SIGMA_PX) ** 2, 9.0)


def _vertical_difference(a: Box, b: Box, vertical_px: float) -> float:
    """Return the difference of the rows less `vertical_px` [px], by landmarks or the sides that no border cuts."""
    if a.landmarks_px and b.landmarks_px:
        return float(np.mean(np.subtract(a.landmarks_px, b.landmarks_px)[:, 1])) - vertical_px
    sides = [s for s in (1, 3) if not a.cut[s] and not b.cut[s]]
    if not sides:
        return 0.0
    return float(np.mean([a.xyxy_px[s] - b.xyxy_px[s] for s in sides])) - vertical_px
