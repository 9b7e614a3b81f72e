"""Chance level of the edge metric: its value if the two edge images were unrelated.

If one image's edge pixels were spread evenly over the window, their mean distance to the other's edges would be the
mean over all pixels of the window. It depends on the number and arrangement of edges, not on vergence: a metric of 6 px
is good where chance is 20 px and meaningless where it is 6.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vergence_metric.edges.nearest_edges import NearestEdges

_LATTICE = 20  # points along a window's side: the mean is within 2 % of that over every pixel


@dataclass(frozen=True)
class ChanceLevels:
    """Chance level in each window [px], (n,) float64; NaN where the other image has no edge pixel there."""

    left_to_right_px: NDArray[np.float64]
    right_to_left_px: NDArray[np.float64]


def chance_levels(field: NearestEdges) -> ChanceLevels:
    """Return the mean distance from the window's pixels to the nearest edge pixel, in every window both ways.

    The mean is taken over a lattice of at most 20 by 20 pixels that lie evenly in the window.
    """
    means = [
        [np.sqrt(found, dtype=np.float64).mean() if found[0] < field.unreachable_px2 else np.nan for found in both]
        for both in field.from_lattice(_LATTICE)
    ]
    left_to_right, right_to_left = np.array(means).reshape(-1, 2).T
    return ChanceLevels(left_to_right, right_to_left)
