"""YOLOv5."""

from vergence_metric.boxes.layouts.grid import GridLayout


class YoloV5(GridLayout):
    """`[1, 3 N, 5 + classes]`, three anchors a cell."""

    name = "yolov5"
    description = "rows of centre, size, objectness and class scores, three rows a cell"
    rows_per_cell = 3
