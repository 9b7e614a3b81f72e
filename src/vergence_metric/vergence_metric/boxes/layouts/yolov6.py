"""YOLOv6: its plain export, the end-to-end one with four named outputs, and the one for onnxruntime."""

from collections.abc import Sequence

import numpy as np

from vergence_metric.boxes.layouts.grid import GridLayout
from vergence_metric.boxes.layouts.protocol import Candidates, Layout, Output, WarmUp, whole_ids

_END_TO_END_NAMES = ("num_dets", "det_boxes", "det_scores", "det_classes")


class YoloV6(GridLayout):
    """`[1, N, 5 + classes]`; the objectness is 1 throughout."""

    name = "yolov6"
    description = "rows of centre, size, objectness and class scores, one row a cell"


class YoloV6EndToEnd(Layout):
    """Count, corners, scores and classes as outputs of their own."""

    name = "yolov6_end_to_end"
    description = "num_dets, det_boxes, det_scores, det_classes; suppression inside"
    suppressed = True
    certain = True

    @classmethod
    def matches(cls, warm_up: WarmUp) -> Layout | None:
        """Return this layout if all four names are there."""
        names = list(warm_up.output_names)
        if not all(name in names for name in _END_TO_END_NAMES):
            return None
        return cls(tuple(names.index(name) for name in _END_TO_END_NAMES), warm_up.class_count)

    def check_numbers(self, outputs: Sequence[Output]) -> None:
        """See Layout: of the rows that count."""
        count, *rows = outputs
        n = int(np.asarray(count).reshape(-1)[0])
        boxes, scores, classes = (np.asarray(values).reshape(-1) for values in rows)
        super().check_numbers([count, boxes[: 4 * n], scores[:n], classes[:n]])

    def decode(self, outputs: Sequence[Output], input_px: tuple[int, int], threshold: float) -> Candidates:
        """Return the first num_dets rows; see Layout."""
        count, boxes, scores, classes = outputs
        # Exporters differ in whether the batch is kept, and rows beyond num_dets hold anything.
        n = int(np.asarray(count).reshape(-1)[0])
        return Candidates(
            np.asarray(boxes, np.float64).reshape(-1, 4)[:n],
            np.asarray(scores, np.float64).reshape(-1)[:n],
            whole_ids(np.asarray(classes, np.float64).reshape(-1)[:n]),
        )


class YoloV6Ort(Layout):
    """`[K, 7]`, K as many as the model kept."""

    name = "yolov6_ort"
    description = "rows of batch, corners, class and score; suppression inside"
    suppressed = True

    @classmethod
    def matches(cls, warm_up: WarmUp) -> Layout | None:
        """Return this layout for a single output of seven columns."""
        if len(warm_up.outputs) != 1 or warm_up.outputs[0].ndim != 2 or warm_up.outputs[0].shape[1] != 7:
            return None
        return cls((0,), warm_up.class_count)

    def decode(self, outputs: Sequence[Output], input_px: tuple[int, int], threshold: float) -> Candidates:
        """Return the rows of the first image; see Layout."""
        rows = np.asarray(outputs[0], np.float64)
        rows = rows[rows[:, 0] == 0]
        return Candidates(rows[:, 1:5], rows[:, 6], whole_ids(rows[:, 5]))
