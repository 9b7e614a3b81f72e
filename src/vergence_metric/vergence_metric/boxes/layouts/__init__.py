"""Layouts of detectors' outputs, one class each. A new one is a class and a call of `register_layout`."""

from vergence_metric.boxes.layouts.protocol import Candidates, Layout, WarmUp
from vergence_metric.boxes.layouts.recognition import AUTO, find_layout
from vergence_metric.boxes.layouts.registry import layout_names, register_layout
from vergence_metric.boxes.layouts.yolov5 import YoloV5
from vergence_metric.boxes.layouts.yolov6 import YoloV6, YoloV6EndToEnd, YoloV6Ort
from vergence_metric.boxes.layouts.yolov8 import YoloV8, YoloV8Rows
from vergence_metric.boxes.layouts.yolov10 import YoloV10
from vergence_metric.boxes.layouts.yolox import YoloX, YoloXDecoded
from vergence_metric.boxes.layouts.yunet import YuNet

__all__ = ["AUTO", "Candidates", "Layout", "WarmUp", "find_layout", "layout_names", "register_layout"]

for _layout in (YoloV6, YoloV6EndToEnd, YoloV6Ort, YoloX, YoloXDecoded, YoloV5, YoloV8, YoloV8Rows, YoloV10, YuNet):
    register_layout(_layout)
