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

from vergence_metric.nearest_edges import LEFT_TO_RIGHT, RIGHT_TO_LEFT, NearestEdges
from vergence_metric.windows import Window


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
    n = len(field.windows)
    points = [field.edge_points(direction, i) for direction in (LEFT_TO_RIGHT, RIGHT_TO_LEFT) for i in range(n)]
    squares = field.squared_distances(points)
    left_count = np.array([len(p) for p in points[:n]], np.int64)
    right_count = np.array([len(p) for p in points[n:]], np.int64)
    measurable = (left_count > 0) & (right_count > 0)
    means = [
        np.sqrt(found, dtype=np.float64).mean() if ok else np.nan
        for found, ok in zip(squares, np.tile(measurable, 2), strict=True)
    ]
    return EdgeDistances(
        np.array(means[:n]),
        np.array(means[n:]),
        left_count,
        right_count,
        window_status(field.windows, left_count, right_count),
    )


def window_status(
    windows: Sequence[Window], left_count: NDArray[np.int64], right_count: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """Return the WindowStatus of each window from its numbers of edge pixels."""
    status = np.array([WindowStatus.WINDOW_CLIPPED if w.clipped else WindowStatus.OK for w in windows], np.uint8)
    status[left_count == 0] = WindowStatus.NO_LEFT_EDGES
    status[right_count == 0] = WindowStatus.NO_RIGHT_EDGES
    status[(left_count == 0) & (right_count == 0)] = WindowStatus.NO_EDGES
    return status
