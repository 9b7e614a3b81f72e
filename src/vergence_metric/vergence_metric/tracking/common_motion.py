"""The motion that most of many corners share, where each may have moved to several places: Hough's vote."""

import math

import numpy as np

from vergence_metric.tracking.eye_view import Points

_CELL_PX = 3.0
_PRIOR = 0.25  # exponent by which a motion at the rim of the reach counts less


def common_motion(offsets: Points, reach_px: float) -> Points:
    """Return the offset (2,) within reach that most of `offsets` (K, 2) [px] share; zero where there are none.

    Motions are counted in cells of 9 by 9 px, a smaller one counts more.
    """
    near = offsets[(np.abs(offsets) <= reach_px).all(axis=1)]
    if not len(near):
        return np.zeros(2)
    cells = 2 * math.ceil(reach_px / _CELL_PX) + 1
    index = np.rint(near / _CELL_PX).astype(int) + cells // 2
    votes = np.zeros((cells + 2, cells + 2))
    np.add.at(votes, (index[:, 1] + 1, index[:, 0] + 1), 1.0)
    counts = np.sum([votes[j : j + cells, i : i + cells] for j in range(3) for i in range(3)], axis=0)
    steps = (np.arange(cells) - cells // 2) * _CELL_PX
    weights = np.exp(-_PRIOR * np.add.outer(steps**2, steps**2) / reach_px**2)
    j, i = divmod(int((counts * weights).argmax()), cells)
    same = (np.abs(near - (steps[i], steps[j])) <= 1.5 * _CELL_PX).all(axis=1)
    return np.asarray(np.median(near[same], axis=0))
