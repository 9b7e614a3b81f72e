"""Optimal assignment of rows to columns of a cost matrix (Kuhn 1955, by shortest augmenting paths)."""

import math

import numpy as np
from numpy.typing import NDArray


def optimal_assignment(costs: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Return the (row, column) pairs with the most pairs, and of those the least sum.

    Args:
        costs: (rows, columns); inf where the two cannot be a pair.

    """
    rows, columns = costs.shape
    if rows == 0 or columns == 0:
        return []
    finite = costs[np.isfinite(costs)]
    if not finite.size:
        return []
    # A row without a partner costs more than any sum of pairs, so that as many as possible are paired.
    unpaired = float(finite.max()) * min(rows, columns) + 1.0
    side = max(rows, columns)
    square = np.full((side, side), unpaired)
    square[:rows, :columns] = np.where(np.isfinite(costs), costs, unpaired)
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
