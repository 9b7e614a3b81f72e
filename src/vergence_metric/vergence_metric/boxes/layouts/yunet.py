"""YuNet: faces with five landmarks (Wu et al., "YuNet: A tiny millisecond-level face detector", 2023)."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from vergence_metric.boxes.layouts.grid import cell_centres, cells
from vergence_metric.boxes.layouts.protocol import Candidates, Layout, Output, WarmUp
from vergence_metric.boxes.preprocessing import Preprocessing

_PARTS = ("cls", "obj", "bbox", "kps")
_COLUMNS = {"cls": 1, "obj": 1, "bbox": 4, "kps": 10}


class YuNet(Layout):
    """`cls_*`, `obj_*`, `bbox_*` and `kps_*` of each stride: `[1, N, 1]`, `[1, N, 1]`, `[1, N, 4]` and `[1, N, 10]`.

    Boxes are offsets from the cell's corner and logarithms of sizes, in strides; landmarks are offsets too. The score
    is the geometric mean of `cls` and `obj`. Input: BGR bytes, black borders right and below.
    """

    name = "yunet"
    description = "class, objectness, undecoded boxes and five landmarks of each stride"
    certain = True
    class_names = ("face",)
    default_threshold = 0.6

    @classmethod
    def matches(cls, warm_up: WarmUp) -> Layout | None:
        """Return this layout if every stride has its four outputs, with a row for each cell."""
        places = {name: i for i, name in enumerate(warm_up.output_names)}
        named = (re.fullmatch(r"cls_(\d+)", name) for name in places)
        strides = tuple(sorted(int(match[1]) for match in named if match))
        names = [f"{part}_{stride}" for stride in strides for part in _PARTS]
        if not strides or strides[0] == 0 or not all(name in places for name in names):
            return None
        for stride in strides:
            for part in _PARTS:
                shape = (1, cells(warm_up.input_px, (stride,)), _COLUMNS[part])
                if warm_up.outputs[places[f"{part}_{stride}"]].shape != shape:
                    return None
        return cls(tuple(places[name] for name in names), 1, strides)

    def preprocessing(self, dtype: Any) -> Preprocessing:
        """Return BGR, 0 to 255, black borders right and below only."""
        return Preprocessing("bgr", False, "corner", border=0)

    def decode(self, outputs: Sequence[Output], input_px: tuple[int, int], threshold: float) -> Candidates:
        """Return the cells whose score reaches the threshold; see Layout."""
        boxes, scores, landmarks = [], [], []
        for i, stride in enumerate(self.strides):
            kind, there, box, points = (
                np.asarray(output[0], np.float64) for output in outputs[len(_PARTS) * i : len(_PARTS) * (i + 1)]
            )
            score = np.sqrt(np.clip(kind[:, 0], 0.0, 1.0) * np.clip(there[:, 0], 0.0, 1.0))
            likely = np.flatnonzero(score >= threshold)
            corner = cell_centres(input_px, stride)[likely] - 0.5 * stride
            centre, half = corner + stride * box[likely, :2], 0.5 * stride * np.exp(box[likely, 2:])
            boxes.append(np.hstack([centre - half, centre + half]))
            scores.append(score[likely])
            landmarks.append(corner[:, None] + stride * points[likely].reshape(-1, 5, 2))
        found = np.concatenate(scores)
        return Candidates(np.concatenate(boxes), found, np.zeros(len(found), np.int64), np.concatenate(landmarks))
