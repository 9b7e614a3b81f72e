"""Metric I of the paper: mean distance from the edge pixels of one image to the nearest of the other, per window.

For edge pixels A of one image and B of the other inside one centre window,

    metric(A, B) = (1/|A|) sum over a in A of min over b in B of |a - b|   [px],

in both directions. Nearest neighbours never lie outside the window.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
from numpy.typing import NDArray

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


def edge_distances(
    left_mask: NDArray[np.uint8], right_mask: NDArray[np.uint8], windows: Sequence[Window]
) -> EdgeDistances:
    """Return the metric of two edge masks (h, w), nonzero at edge pixels, in every window.

    Equal to the pairwise definition up to the rounding of float64.
    """
    n = len(windows)
    left_to_right, right_to_left = np.full(n, np.nan), np.full(n, np.nan)
    left_count, right_count = np.zeros(n, np.int64), np.zeros(n, np.int64)
    for i, window in enumerate(windows):
        left, right = left_mask[window.slices], right_mask[window.slices]
        left_count[i], right_count[i] = cv2.countNonZero(left), cv2.countNonZero(right)
        if left_count[i] and right_count[i]:
            left_to_right[i] = _mean_distance(left, right)
            right_to_left[i] = _mean_distance(right, left)
    return EdgeDistances(
        left_to_right, right_to_left, left_count, right_count, window_status(windows, left_count, right_count)
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


def _mean_distance(from_mask: NDArray[np.uint8], to_mask: NDArray[np.uint8]) -> float:
    distance = cv2.distanceTransform((to_mask == 0).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    nearest = distance[from_mask > 0].astype(np.float64)
    # the transform is float32; squared distances between pixels are whole numbers, so rounding makes it exact
    return float(np.sqrt(np.rint(nearest * nearest)).mean())
