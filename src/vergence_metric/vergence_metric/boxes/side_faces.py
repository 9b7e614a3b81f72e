"""Faces at an object's sides that one eye sees too narrow to be matched: their disparities from the boxes' own sides.

Where both eyes see such a face, its outer edge is the side of both boxes, and the disparity of a plane runs evenly from
there to where matching begins. Left out, the mean over the surface would be that of the nearer faces.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.corner_metric import LEFT, RIGHT
from vergence_metric.boxes.dense_matching import DenseMatch, DenseView
from vergence_metric.boxes.detections import Box

_MATCHED = 0.6  # of a column's pixels: the face that could be matched has begun
_BARE = 0.5  # of the pixels outside it unmatched: a turned object's corners are not a face
_LEAST_SHARE = 0.05  # of the box's width: less changes nothing
_LEAST_SEEN_PX = 2.0  # by the other eye: else that may not see the face at all
_BESIDE = 3  # columns from which the disparity where matching begins is taken


@dataclass(frozen=True)
class _Strip:
    """Columns at one side of one eye's box, from its outer one inwards, the unmatched pixels, the disparity beside."""

    columns: NDArray[np.intp]
    bare: NDArray[np.bool_]
    edge_px: float


def side_values(match: DenseMatch, left_box: Box, right_box: Box, near: tuple[NDArray[np.bool_], ...]) -> list[float]:
    """Return the disparities [px] of the pixels of both eyes that are classed as side faces.

    Args:
        match: of the boxes.
        left_box: the object in the left image.
        right_box: the same in the right image.
        near: (h, w) for each eye, where its match is the object's.

    """
    values: list[float] = []
    least_px = _LEAST_SHARE * left_box.size_px[0]
    for side in (LEFT, RIGHT):
        if left_box.cut[side] or right_box.cut[side]:
            continue
        outer = left_box.xyxy_px[side] - right_box.xyxy_px[side]
        strips = [_strip(view, kept, side == RIGHT) for view, kept in zip((match.left, match.right), near, strict=True)]
        wide = max(strips, key=lambda strip: len(strip.columns))
        seen_px, inner = match.scale * len(wide.columns), wide.edge_px
        if seen_px < least_px or wide.bare.mean() < _BARE or not outer <= inner:
            continue
        # The other eye sees as much less of the face as the disparity changes over it.
        if seen_px - (inner - outer) < _LEAST_SEEN_PX:
            continue
        for strip in strips:
            share = (np.arange(len(strip.columns)) + 0.5) / max(len(strip.columns), 1)
            values += np.repeat(outer + share * (inner - outer), strip.bare.sum(0)).tolist()
    return values


def _strip(view: DenseView, near: NDArray[np.bool_], at_right: bool) -> _Strip:
    columns, rows = np.flatnonzero(view.inside.any(0)), np.flatnonzero(view.inside.any(1))
    if not columns.size:
        return _Strip(columns, view.inside[:, :0], math.nan)
    if at_right:
        columns = columns[::-1]
    found = near[np.ix_(rows, columns)]
    poor = np.flatnonzero(found[:, : len(columns) // 2].mean(0) < _MATCHED)
    first = int(poor[-1]) + 1 if poor.size else 0
    beside = np.ix_(rows, columns[first : first + _BESIDE])
    known = view.disparity_px[beside][near[beside]]
    # Rows in which nothing is matched beside the face are above or below it: a turned object's corners.
    level = found[:, first : first + _BESIDE].any(1)
    return _Strip(columns[:first], ~found[level, :first], float(np.median(known)) if known.size else math.nan)
