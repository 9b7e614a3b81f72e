"""Which of the known layouts a detector's output has: by metadata, output names and the shapes of one warm-up run.

Declared shapes are not looked at: exporters get them wrong.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.errors import ModelLayoutError

END_TO_END_NAMES = ("num_dets", "det_boxes", "det_scores", "det_classes")
STRIDE_SETS = ((8, 16, 32), (8, 16, 32, 64), (8, 16), (4, 8, 16, 32), (16, 32))
_V5_ANCHORS = 3

DESCRIPTIONS = {
    "yolov6": "rows of centre, size, objectness and class scores, one row a cell",
    "yolov6_end_to_end": "num_dets, det_boxes, det_scores, det_classes; suppression inside",
    "yolov6_ort": "rows of batch, corners, class and score; suppression inside",
    "yolov5": "rows of centre, size, objectness and class scores, three rows a cell",
    "yolov8": "columns of centre, size and class scores",
    "yolov10": "rows of corners, score and class; suppression inside",
    "yolox": "rows of undecoded centre and size, objectness and class scores",
}


@dataclass(frozen=True)
class Layout:
    """A layout's name, which outputs it takes, in order, how many classes there are (None: not told), and strides."""

    name: str
    outputs: tuple[int, ...]
    classes: int | None
    strides: tuple[int, ...] = ()

    @property
    def suppressed(self) -> bool:
        """True if the model itself has left out overlapping boxes."""
        return self.name in ("yolov6_end_to_end", "yolov6_ort", "yolov10")

    def __str__(self) -> str:
        count = "" if self.classes is None else f", {self.classes} class{'' if self.classes == 1 else 'es'}"
        return f"{self.name} ({DESCRIPTIONS[self.name]}{count})"


def cells(input_px: tuple[int, int], strides: Sequence[int]) -> int:
    """Return how many cells an input of (width, height) has over all strides."""
    return sum(math.ceil(input_px[0] / s) * math.ceil(input_px[1] / s) for s in strides)


def find_layout(
    names: Sequence[str],
    outputs: Sequence[NDArray[Any]],
    input_px: tuple[int, int],
    metadata: Mapping[str, str],
    wanted: str = "auto",
    class_count: int | None = None,
) -> Layout:
    """Return the layout of a model.

    Args:
        names: its outputs' names.
        outputs: what one run gave.
        input_px: (width, height) that it was run with.
        metadata: the file's own words; `task` and `layout` are heeded.
        wanted: a layout's name, or auto.
        class_count: number of class names in the metadata, None if there are none.

    Raises:
        ModelLayoutError: no detector, or a layout that is unknown, ambiguous or not the one wanted.

    """
    task = metadata.get("task", "detect")
    if task != "detect":
        raise ModelLayoutError(f"the model's task is {task!r}: allowed is 'detect'")
    candidates = _candidates(names, outputs, input_px, class_count)
    if wanted == "auto" and any(c.name == metadata.get("layout") for c in candidates):
        wanted = metadata["layout"]
    shapes = ", ".join(f"{name} {list(output.shape)}" for name, output in zip(names, outputs, strict=True))
    if wanted != "auto":
        for candidate in candidates:
            if candidate.name == wanted:
                return candidate
        raise ModelLayoutError(f"the model's outputs are {shapes}: they do not have the layout {wanted!r}")
    if not candidates:
        raise ModelLayoutError(
            f"the model's outputs for an input of {input_px[0]}x{input_px[1]} are {shapes}: none of the known "
            f"detector layouts ({', '.join(DESCRIPTIONS)})"
        )
    sure = candidates if len(candidates) == 1 else _by_values(candidates, outputs, input_px)
    if len(sure) != 1:
        raise ModelLayoutError(
            f"the model's outputs {shapes} could be {' or '.join(c.name for c in candidates)}: say which by 'layout'"
        )
    return sure[0]


def _candidates(
    names: Sequence[str], outputs: Sequence[NDArray[Any]], input_px: tuple[int, int], class_count: int | None
) -> list[Layout]:
    if all(name in names for name in END_TO_END_NAMES):
        chosen = tuple(list(names).index(name) for name in END_TO_END_NAMES)
        return [Layout("yolov6_end_to_end", chosen, class_count)]
    found: list[Layout] = []
    for index, output in enumerate(outputs):
        if output.ndim == 2 and output.shape[1] == 7 and len(outputs) == 1:
            found.append(Layout("yolov6_ort", (index,), class_count))
        if output.ndim != 3 or output.shape[0] != 1:
            continue
        found += _dense(index, output.shape[1], output.shape[2], input_px, class_count)
        if output.shape[2] == 6 and output.shape[1] <= 3000:
            found.append(Layout("yolov10", (index,), class_count))
        if found:
            break  # further outputs are the same again before decoding
    return found


def _dense(index: int, rows: int, columns: int, input_px: tuple[int, int], class_count: int | None) -> list[Layout]:
    found = []
    for strides in STRIDE_SETS:
        count = cells(input_px, strides)
        by_row = columns - 5
        if rows == count and by_row >= 1 and class_count in (None, by_row):
            found += [Layout(name, (index,), by_row, strides) for name in ("yolov6", "yolox")]
        if rows == _V5_ANCHORS * count and by_row >= 1 and class_count in (None, by_row):
            found.append(Layout("yolov5", (index,), by_row, strides))
        if columns == count and rows >= 5 and class_count in (None, rows - 4):
            found.append(Layout("yolov8", (index,), rows - 4, strides))
    return found


def _by_values(candidates: list[Layout], outputs: Sequence[NDArray[Any]], input_px: tuple[int, int]) -> list[Layout]:
    """Keep the candidates whose meaning the warm-up's values bear out."""
    return [c for c in candidates if _bears_out(c, np.asarray(outputs[c.outputs[0]][0], np.float64), input_px)]


def _bears_out(layout: Layout, rows: NDArray[np.float64], input_px: tuple[int, int]) -> bool:
    if layout.name == "yolov8":
        return True
    if layout.name == "yolov10":
        scores, ids = rows[:, 4], rows[:, 5]
        whole = bool((ids == np.rint(ids)).all() and (ids >= 0).all())
        # Objectness is 1 throughout in YOLOv6; end-to-end rows come by falling score and corners in order.
        ordered = bool((np.diff(scores) <= 1e-6).all() and (rows[:, 2:4] >= rows[:, :2] - 1e-3).all())
        return whole and ordered and not bool((scores == 1.0).all())
    # Decoded sizes are not negative and centres go with the cells; undecoded ones are logarithms and offsets.
    decoded = float((rows[:, 2:4] < 0).mean()) < 0.05 and float(np.abs(rows[:, :2]).max(initial=0.0)) > 16.0
    if not (np.abs(rows[:, 4:]) <= 1.0 + 1e-3).all():
        return False
    return decoded if layout.name in ("yolov6", "yolov5") else not decoded
