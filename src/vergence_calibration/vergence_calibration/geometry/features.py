"""Features of many views matched with one another, and their tracks: which sightings are of one thing."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vergence_calibration.eye_turn import Image
from vergence_calibration.geometry.views import Observations

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

_FEATURES = 700
_CELLS = (8, 6)
_CONTRAST = 0.015
_LEAST_SIZE_PX = 3.5  # smaller features follow the pixel grid: on rendered rooms they make all lengths 1 % too long
_RATIO = 0.8
_EPIPOLAR_PX = 1.5
_LEAST_MATCHES = 16


@dataclass(frozen=True)
class Features:
    """Of one view: pixels (n, 2) and SIFT descriptors (n, 128), scaled so that their products are cosines."""

    pixels: Array
    words: npt.NDArray[np.float32]


def features(grey: Image) -> Features:
    """Return the features of a grey image (h, w), spread over it: up to the same number from every cell of a grid."""
    finder = cv2.SIFT.create(4 * _FEATURES, contrastThreshold=_CONTRAST)
    corners = [point for point in finder.detect(grey, None) if point.size > _LEAST_SIZE_PX]
    points, words = finder.compute(grey, corners)
    if not points:
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32))
    pixels = np.array([point.pt for point in points], np.float64) - _offset_px()
    strength = np.array([point.response for point in points])
    # A corner with two orientations is one thing: it keeps the first.
    _, single = np.unique(np.round(pixels, 2), axis=0, return_index=True)
    cell = np.floor(pixels[single] * np.divide(_CELLS, (grey.shape[1], grey.shape[0]))).astype(np.int64) @ (
        1,
        _CELLS[0],
    )
    order = np.lexsort((-strength[single], cell))
    rank = np.arange(len(order)) - np.searchsorted(cell[order], cell[order], side="left")
    kept = np.sort(single[order[rank < _FEATURES // (_CELLS[0] * _CELLS[1])]])
    # Square roots compare better than the histograms themselves (Arandjelovic and Zisserman, 2012).
    rooted = np.sqrt(words[kept] / np.maximum(words[kept].sum(axis=1, keepdims=True), 1e-9))
    return Features(pixels[kept], rooted.astype(np.float32))


@functools.lru_cache(maxsize=1)
def _offset_px() -> float:
    """Return by how much OpenCV's SIFT places features right of and below where they are.

    It is a quarter of a pixel in versions whose first enlargement of the image does not keep its middle, else 0.
    """
    middle, spread = 32.0, 3.0
    along = np.exp(-0.5 * ((np.arange(65) - middle) / spread) ** 2)
    blob = np.round(40 + 180 * np.outer(along, along)).astype(np.uint8)
    points = cv2.SIFT.create().detect(blob, None)
    offsets = [0.5 * (point.pt[0] + point.pt[1]) - middle for point in points]
    return min(offsets, key=abs, default=0.0)


def matches(first: Features, second: Features) -> Indices:
    """Return the pairs (n, 2) of features that match both ways, are unambiguous, and agree on one epipolar geometry."""
    none = np.empty((0, 2), np.int64)
    if min(len(first.pixels), len(second.pixels)) < _LEAST_MATCHES:
        return none
    likeness = first.words @ second.words.T
    there, back = likeness.argmax(axis=1), likeness.argmax(axis=0)
    rows = np.arange(len(there))
    best = likeness[rows, there]
    likeness[rows, there] = -1.0
    next_best = likeness.max(axis=1)
    # Distances of unit vectors.
    clear = (1.0 - best) < _RATIO**2 * (1.0 - next_best)
    found = np.flatnonzero(clear & (back[there] == rows))
    if len(found) < _LEAST_MATCHES:
        return none
    try:
        _, agree = cv2.findFundamentalMat(
            first.pixels[found], second.pixels[there[found]], cv2.USAC_MAGSAC, _EPIPOLAR_PX, 0.999, 2000
        )
    except cv2.error:  # OpenCV 5 asserts where every model it drew was degenerate
        return none
    if agree is None:
        return none
    kept = found[agree.ravel() == 1]
    return np.column_stack([kept, there[kept]]) if len(kept) >= _LEAST_MATCHES else none


def tracks(found: Sequence[Features], pairs: Sequence[tuple[int, int, Indices]], least_views: int = 3) -> Observations:
    """Return the observations of things that were found again in at least `least_views` views.

    A track with two features of one view is ambiguous, and left out.

    Args:
        found: features of each view.
        pairs: (view, other view, matches (n, 2) of their features).
        least_views: of a track.
    """
    first = np.concatenate([[0], np.cumsum([len(features.pixels) for features in found])]).astype(np.int64)
    labels = np.arange(first[-1])
    edges = [np.empty((0, 2), np.int64)]
    edges += [np.add(pair, (first[view], first[other])) for view, other, pair in pairs]
    ends = np.vstack(edges)
    # Every feature takes the least label of those it is joined to, until none changes.
    while len(ends):
        least = np.minimum(labels[ends[:, 0]], labels[ends[:, 1]])
        before = labels.copy()
        np.minimum.at(labels, ends.ravel(), np.repeat(least, 2))
        labels = labels[labels]
        if (labels == before).all():
            break
    view = np.repeat(np.arange(len(found)), np.diff(first))
    kept = np.bincount(labels, minlength=len(labels))[labels] >= least_views
    # Two features of one view under one label.
    _, back, count = np.unique(labels * len(found) + view, return_inverse=True, return_counts=True)
    twice = np.zeros(len(labels), bool)
    twice[labels[count[back] > 1]] = True
    kept &= ~twice[labels]
    _, point = np.unique(labels[kept], return_inverse=True)
    pixels = np.vstack([features.pixels for features in found])
    return Observations(view[kept], point, pixels[kept])


def neighbours(axes: Array, count: int) -> list[tuple[int, int]]:
    """Return the pairs of views to match: each with the `count` whose optical axes (V, 3) are nearest, once."""
    near = np.argsort(-(axes @ axes.T), axis=1)[:, 1 : count + 1]
    return sorted({(min(a, b), max(a, b)) for a, row in enumerate(near.tolist()) for b in row})
