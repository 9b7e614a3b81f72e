"""Metric I of the paper: mean distance from the edge pixels of one image to the nearest of the other, per window.

For edge pixels A of one image and B of the other inside one centre window,

    metric(A, B) = (1/|A|) sum over a in A of min over b in B of |a - b|   [px],

in both directions. Nearest neighbours never lie outside the window.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.nearest_edges import NearestEdges
from vergence_metric.edges.windows import Window


class WindowStatus(IntEnum):
    """Why a window has no figures, or that it was cut; the values of vergence_msgs/EdgeVergence."""

    OK = 0
    NO_LEFT_EDGES = 1
    NO_RIGHT_EDGES = 2
    NO_EDGES = 3
    WINDOW_CLIPPED = 4


@dataclass(frozen=True)
class EdgeDistances:
    """The metric of one pair; element i of each array belongs to window i.

    Distances are float64 px and NaN where a window holds no edge pixel of one image; counts are int64; `status` uint8
    holds WindowStatus values.
    """

    left_to_right_px: NDArray[np.float64]
    right_to_left_px: NDArray[np.float64]
    left_count: NDArray[np.int64]
    right_count: NDArray[np.int64]
    status: NDArray[np.uint8]


def edge_distances(field: NearestEdges) -> EdgeDistances:
    """Return the metric in every window of `field`, equal to the pairwise definition up to float64's rounding."""
    squares = field.from_edges()
    left_count, right_count = np.array([[len(one) for one in both] for both in squares], np.int64).reshape(-1, 2).T
    measurable = (left_count > 0) & (right_count > 0)
    means = [
        [np.sqrt(found, dtype=np.float64).mean() if ok else np.nan for found in both]
        for both, ok in zip(squares, measurable, strict=True)
    ]
    left_to_right, right_to_left = np.array(means).reshape(-1, 2).T
    status = window_status(field.windows, left_count, right_count)
    return EdgeDistances(left_to_right, right_to_left, left_count, right_count, status)


def window_status(
    windows: Sequence[Window], left_count: NDArray[np.int64], right_count: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """Return the WindowStatus of each window from its numbers of edge pixels."""
    status = np.array([WindowStatus.WINDOW_CLIPPED if w.clipped else WindowStatus.OK for w in windows], np.uint8)
    status[left_count == 0] = WindowStatus.NO_LEFT_EDGES
    status[right_count == 0] = WindowStatus.NO_RIGHT_EDGES
    status[(left_count == 0) & (right_count == 0)] = WindowStatus.NO_EDGES
    return status
