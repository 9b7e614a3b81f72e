"""YOLOv8, YOLOv9, YOLO11 and what has their output."""

from dataclasses import replace

import numpy as np

from vergence_metric.boxes.layouts.grid import GridLayout
from vergence_metric.boxes.layouts.protocol import Layout, Output, WarmUp


class YoloV8(GridLayout):
    """`[1, 4 + classes, N]`, without objectness."""

    name = "yolov8"
    description = "columns of centre, size and class scores"
    objectness = False

    @classmethod
    def rows(cls, output: Output) -> Output:
        """Return the output's columns (4 + classes, N) as rows."""
        return output.T

    @classmethod
    def matches(cls, warm_up: WarmUp) -> Layout | None:
        """Return this layout for the last of equal outputs that fit: the first is YOLOv9's auxiliary branch."""
        found = super().matches(warm_up)
        if found is None:
            return None
        shape = warm_up.outputs[found.outputs[0]].shape
        last = max(i for i, output in enumerate(warm_up.outputs) if output.shape == shape)
        return replace(found, outputs=(last,))

    def explains(self, output: Output, warm_up: WarmUp) -> bool:
        """See Layout; the auxiliary branch of YOLOv9 has the shape of the main one."""
        return super().explains(output, warm_up) or output.shape == warm_up.outputs[self.outputs[0]].shape


class YoloV8Rows(GridLayout):
    """`[1, N, 4 + classes]`: the output of YOLOv8 transposed by an exporter."""

    name = "yolov8_rows"
    description = "rows of centre, size and class scores"
    objectness = False

    def contradiction(self, warm_up: WarmUp) -> str:
        """See Layout; the names that YOLOX's and YOLOv6's exporters give their output belong to those."""
        name = warm_up.output_names[self.outputs[0]]
        if name in ("output", "outputs"):
            return f"its output must not have the name {name!r} of YOLOX's or YOLOv6's"
        first = self._warm_up_rows(warm_up)[:, 4]
        if (np.abs(first - 1.0) < 1e-3).all():
            return "its first class must not score 1 throughout"
        return super().contradiction(warm_up)
