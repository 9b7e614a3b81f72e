"""From a network's raw output to boxes, scores and classes, layout by layout."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.layouts import Layout

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Raw:
    """Candidates: `xyxy` (K, 4) counted from the input's corner [input px], `scores` (K,), `class_ids` (K,)."""

    xyxy: Array
    scores: Array
    class_ids: NDArray[np.int64]


def decode(layout: Layout, outputs: Sequence[NDArray[Any]], input_px: tuple[int, int], threshold: float) -> Raw:
    """Return the candidates of one image whose score reaches the threshold; values that are not finite are left out."""
    chosen = [outputs[i] for i in layout.outputs]
    if layout.name == "yolov6_end_to_end":
        raw = _end_to_end(*chosen)
    elif layout.name == "yolov6_ort":
        rows = np.asarray(chosen[0], np.float64)
        rows = rows[rows[:, 0] == 0]
        raw = Raw(rows[:, 1:5], rows[:, 6], _ids(rows[:, 5]))
    elif layout.name == "yolov10":
        rows = np.asarray(chosen[0][0], np.float64)
        raw = Raw(rows[:, :4], rows[:, 4], _ids(rows[:, 5]))
    else:
        raw = _dense(layout, chosen[0][0], input_px, threshold)
    good = (raw.scores >= threshold) & np.isfinite(raw.xyxy).all(1) & np.isfinite(raw.scores)
    good &= (raw.xyxy[:, 2:] > raw.xyxy[:, :2]).all(1)
    return Raw(raw.xyxy[good], raw.scores[good], raw.class_ids[good])


def _end_to_end(count: NDArray[Any], boxes: NDArray[Any], scores: NDArray[Any], classes: NDArray[Any]) -> Raw:
    # Exporters differ in whether the batch is kept, and rows beyond num_dets hold anything.
    n = int(np.asarray(count).reshape(-1)[0])
    return Raw(
        np.asarray(boxes, np.float64).reshape(-1, 4)[:n],
        np.asarray(scores, np.float64).reshape(-1)[:n],
        _ids(np.asarray(classes, np.float64).reshape(-1)[:n]),
    )


def _dense(layout: Layout, output: NDArray[Any], input_px: tuple[int, int], threshold: float) -> Raw:
    rows = output.T if layout.name == "yolov8" else output
    first = 4 if layout.name == "yolov8" else 5
    class_scores = rows[:, first:]
    ids = class_scores.argmax(1)
    scores = np.asarray(class_scores[np.arange(len(rows)), ids], np.float64)
    if first == 5:
        scores = scores * rows[:, 4]
    likely = np.flatnonzero(scores >= threshold)
    boxes = np.asarray(rows[likely, :4], np.float64)
    if layout.name == "yolox":
        boxes = _decoded(boxes, likely, layout.strides, input_px)
    half = 0.5 * boxes[:, 2:]
    corners = np.concatenate([boxes[:, :2] - half, boxes[:, :2] + half], axis=1)
    return Raw(corners, scores[likely], ids[likely].astype(np.int64))


def _decoded(boxes: Array, places: NDArray[np.int64], strides: Sequence[int], input_px: tuple[int, int]) -> Array:
    """Return centre and size [px] of YOLOX's offsets from cells and logarithms of sizes, both in strides."""
    grid, scale = [], []
    for stride in strides:
        columns, rows = -(-input_px[0] // stride), -(-input_px[1] // stride)
        y, x = np.mgrid[0:rows, 0:columns]
        grid.append(np.column_stack([x.ravel(), y.ravel()]))
        scale.append(np.full(rows * columns, stride))
    cell, stride_of = np.concatenate(grid)[places], np.concatenate(scale)[places][:, None]
    return np.concatenate([(boxes[:, :2] + cell) * stride_of, np.exp(boxes[:, 2:]) * stride_of], axis=1)


def _ids(values: Array) -> NDArray[np.int64]:
    return np.rint(np.nan_to_num(values, nan=-1.0)).astype(np.int64)
