"""YOLOv10, YOLO26, and YOLOv8 exported with suppression inside."""

from collections.abc import Sequence

import numpy as np

from vergence_metric.boxes.layouts.protocol import Candidates, Layout, Output, WarmUp, whole_ids

_MOST_ROWS = 3000


class YoloV10(Layout):
    """`[1, K, 6]`, by falling score."""

    name = "yolov10"
    description = "rows of corners, score and class; suppression inside"
    suppressed = True

    @classmethod
    def matches(cls, warm_up: WarmUp) -> Layout | None:
        """Return this layout for the first output of six columns."""
        for index, output in enumerate(warm_up.outputs):
            if output.ndim == 3 and output.shape[0] == 1 and output.shape[2] == 6 and output.shape[1] <= _MOST_ROWS:
                return cls((index,), warm_up.class_count)
        return None

    def contradiction(self, warm_up: WarmUp) -> str:
        """See Layout: classes are whole numbers, scores are shares that fall, corners are in order."""
        rows = np.asarray(warm_up.outputs[self.outputs[0]][0], np.float64)
        scores, ids = rows[:, 4], rows[:, 5]
        if not ((ids == np.rint(ids)) & (ids >= 0)).all():
            return "column 5 must be numbers of classes"
        if warm_up.class_count is not None and (ids >= warm_up.class_count).any():
            return f"column 5 must be numbers of its {warm_up.class_count} classes: got up to {ids.max():g}"
        if not ((scores >= 0.0) & (scores <= 1.0 + 1e-3)).all() or (np.diff(scores) > 1e-3).any():
            return "column 4 must be scores from 1 to 0 that fall"
        # Where this column is 1 throughout it is the objectness of YOLOv6.
        if len(scores) > 1 and (scores == 1.0).all():
            return "column 4 must be scores: it is 1 throughout"
        if not (rows[:, 2:4] >= rows[:, :2] - 1e-3).all():
            return "its corners must be in order"
        return ""

    def decode(self, outputs: Sequence[Output], input_px: tuple[int, int], threshold: float) -> Candidates:
        """Return all rows; see Layout."""
        rows = np.asarray(outputs[0][0], np.float64)
        return Candidates(rows[:, :4], rows[:, 4], whole_ids(rows[:, 5]))
