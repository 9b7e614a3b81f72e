"""YOLOv8 and YOLO11."""

from vergence_metric.boxes.layouts.grid import GridLayout
from vergence_metric.boxes.layouts.protocol import Output, WarmUp


class YoloV8(GridLayout):
    """`[1, 4 + classes, N]`, without objectness."""

    name = "yolov8"
    description = "columns of centre, size and class scores"
    objectness = False

    @classmethod
    def rows(cls, output: Output) -> Output:
        """Return the output's columns (4 + classes, N) as rows."""
        return output.T

    def values_agree(self, warm_up: WarmUp) -> bool:
        """Return True: the shape, columns for rows, is its own."""
        return True
