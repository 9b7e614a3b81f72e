"""How good a detector is: average precision by class and size, and scores at a threshold. Needs no torch."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Boxes = NDArray[np.float64]
OVERLAPS = tuple(round(0.5 + 0.05 * i, 2) for i in range(10))


@dataclass(frozen=True)
class ImageResult:
    """One class in one image: found boxes (K, 4) with scores (K,), true ones (M, 4), and which of those to ignore.

    An ignored truth (another size, hardly visible) counts neither as missed nor as a false detection.
    """

    found: Boxes
    scores: NDArray[np.float64]
    truth: Boxes
    ignored: NDArray[np.bool_]


def iou_matrix(a: Boxes, b: Boxes) -> NDArray[np.float64]:
    """Return (K, M) intersections over unions of boxes (K, 4) and (M, 4)."""
    low = np.maximum(a[:, None, :2], b[None, :, :2])
    high = np.minimum(a[:, None, 2:], b[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(-1)
    area_a, area_b = ((boxes[:, 2:] - boxes[:, :2]).prod(-1) for boxes in (a, b))
    return np.asarray(shared / np.maximum(area_a[:, None] + area_b[None] - shared, 1e-12))


def average_precision(results: list[ImageResult], overlap: float) -> float:
    """Return the area under the interpolated precision-recall curve (all points) at one overlap; NaN without truth."""
    hits: list[bool] = []
    scores: list[float] = []
    wanted = 0
    for result in results:
        wanted += int((~result.ignored).sum())
        taken = np.zeros(len(result.truth), bool)
        overlaps = iou_matrix(result.found, result.truth)
        for k in np.argsort(-result.scores, kind="stable"):
            open_truths = np.flatnonzero(~taken & (overlaps[k] >= overlap)) if len(result.truth) else np.empty(0, int)
            if open_truths.size:
                # A truth that counts is preferred to an ignored one.
                best = max(open_truths, key=lambda m: (not result.ignored[m], overlaps[k, m]))
                taken[best] = True
                if result.ignored[best]:
                    continue
            elif result.ignored.any() and (overlaps[k][result.ignored] >= overlap).any():
                continue
            hits.append(bool(open_truths.size))
            scores.append(float(result.scores[k]))
    if not wanted:
        return float("nan")
    order = np.argsort(-np.asarray(scores), kind="stable")
    right = np.cumsum(np.asarray(hits, bool)[order]) if hits else np.empty(0)
    recall = right / wanted
    precision = right / np.arange(1, len(right) + 1)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float(np.sum(np.diff(recall, prepend=0.0) * envelope))


def mean_average_precision(results: list[ImageResult]) -> float:
    """Return the mean of the average precision over overlaps 0.50, 0.55 to 0.95 (COCO's AP)."""
    return float(np.mean([average_precision(results, overlap) for overlap in OVERLAPS]))
