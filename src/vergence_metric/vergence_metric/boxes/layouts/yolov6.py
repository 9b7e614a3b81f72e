"""YOLOv6: its plain export, the end-to-end one with four named outputs, and the one for onnxruntime."""

from collections.abc import Sequence

import numpy as np

from vergence_metric.boxes.errors import DetectorError
from vergence_metric.boxes.layouts.grid import GridLayout, objectness_is_one
from vergence_metric.boxes.layouts.protocol import Array, Candidates, Layout, Output, WarmUp, whole_ids

_END_TO_END_NAMES = ("num_dets", "det_boxes", "det_scores", "det_classes")


class YoloV6(GridLayout):
    """`[1, N, 5 + classes]`; the objectness is 1 throughout, but for the first release's."""

    name = "yolov6"
    description = "rows of centre, size, objectness and class scores, one row a cell"

    def contradiction(self, warm_up: WarmUp) -> str:
        """See Layout; an objectness that differs from cell to cell under the name of YOLOX's output is YOLOX's."""
        name = warm_up.output_names[self.outputs[0]]
        if name == "output" and not objectness_is_one(self._warm_up_rows(warm_up)):
            return "its objectness must be 1 throughout"
        return super().contradiction(warm_up)


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

    def contradiction(self, warm_up: WarmUp) -> str:
        """See Layout: class numbers are whole, scores are shares; YOLO-NAS has the two the other way round."""
        name, rows = warm_up.output_names[0], np.asarray(warm_up.outputs[0], np.float64)
        if "flat_predictions" in name:
            return f"its output must not have the name {name!r} of YOLO-NAS's, whose columns are in another order"
        return _ort_contradiction(rows)

    def decode(self, outputs: Sequence[Output], input_px: tuple[int, int], threshold: float) -> Candidates:
        """Return the rows of the first image; see Layout. Raises DetectorError for rows that are none of this layout.

        The warm-up's picture may show no object, so that the first rows are those of an image.
        """
        rows = np.asarray(outputs[0], np.float64)
        wrong = _ort_contradiction(rows)
        if wrong:
            raise DetectorError(f"rows of the layout {self.name!r}: {wrong}")
        rows = rows[rows[:, 0] == 0]
        return Candidates(rows[:, 1:5], rows[:, 6], whole_ids(rows[:, 5]))


def _ort_contradiction(rows: Array) -> str:
    ids, scores = rows[:, 5], rows[:, 6]
    if not ((ids == np.rint(ids)) & (ids >= 0)).all():
        return "column 5 must be numbers of classes"
    if not ((scores >= 0.0) & (scores <= 1.0 + 1e-3)).all():
        return "column 6 must be scores from 0 to 1"
    return ""
