"""Greedy non-maximum suppression within each class."""

import numpy as np
from numpy.typing import NDArray


def suppress(
    xyxy: NDArray[np.float64], scores: NDArray[np.float64], class_ids: NDArray[np.int64], iou: float, most: int
) -> NDArray[np.int64]:
    """Return the indices of the boxes kept, best first.

    A box goes if a better one of its class overlaps it (intersection over union) by more than `iou`.
    """
    order = np.argsort(-scores, kind="stable")
    areas = np.clip(xyxy[:, 2:] - xyxy[:, :2], 0, None).prod(1)
    kept: list[int] = []
    while order.size and len(kept) < most:
        best, rest = order[0], order[1:]
        kept.append(int(best))
        low = np.maximum(xyxy[best, :2], xyxy[rest, :2])
        high = np.minimum(xyxy[best, 2:], xyxy[rest, 2:])
        shared = np.clip(high - low, 0, None).prod(1)
        overlap = shared / np.maximum(areas[best] + areas[rest] - shared, 1e-9)
        order = rest[(overlap <= iou) | (class_ids[rest] != class_ids[best])]
    return np.array(kept, np.int64)
