"""Whether every family's export is recognised: built with the family's outputs, with 1, 2 and 80 classes."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bench.results import Row
from vergence_metric.boxes import Detector, DetectorError
from vergence_metric.boxes.parameters import DetectorParameters
from vergence_metric.testing.onnx_detectors import build_detector

FAMILIES = {
    "YOLOv5": ("yolov5", {}),
    "YOLOv6": ("yolov6", {}),
    "YOLOv7": ("yolov7", {}),
    "YOLOv8": ("yolov8", {"task": "detect", "stride": "32"}),
    "YOLOv9": ("yolov9", {}),
    "YOLOv10": ("yolov10", {"task": "detect", "stride": "32"}),
    "YOLO11": ("yolov8", {"task": "detect", "stride": "32", "imgsz": "[224, 320]"}),
    "YOLO26": ("yolov10", {"task": "detect", "stride": "32", "imgsz": "[224, 320]"}),
    "YOLOX": ("yolox", {}),
}
"""The layout that is built and the metadata of each family's own export."""

CLASS_COUNTS = (1, 2, 80)
_SIZE_PX = 320, 224
_CELL = (slice(64, 80), slice(96, 112))
_NEAR_PX = 1.0


def rows(say: Callable[[str], None]) -> list[Row]:
    """Build, load and detect."""
    recognised, right, refused = 0, 0, []
    image = np.zeros((_SIZE_PX[1], _SIZE_PX[0], 3), np.uint8)
    image[(*_CELL, 2)] = 255
    expected = np.array([_CELL[1].start, _CELL[0].start, _CELL[1].stop, _CELL[0].stop]) - 0.5
    with TemporaryDirectory() as folder:
        for family, (layout, metadata) in FAMILIES.items():
            for classes in CLASS_COUNTS:
                path = build_detector(Path(folder) / "model.onnx", layout, _SIZE_PX, classes, metadata=metadata)
                try:
                    found = Detector(DetectorParameters(model=str(path), threshold=0.5)).detect(image)
                except DetectorError as error:
                    refused.append(f"{family}, {classes} classes: {error}")
                    continue
                recognised += 1
                boxes = found.xyxy_px
                right += len(boxes) == 1 and bool(np.abs(boxes[0] - expected).max() < _NEAR_PX)
    for line in refused:
        say(f"refused: {line}")
    total = len(FAMILIES) * len(CLASS_COUNTS)
    say(f"{recognised} of {total} exports are recognised, {right} read right, {len(refused)} refused")
    return [
        Row("people.layout_told", right / total, f"share of {total} exports recognised and read right"),
        Row("people.layout_refused", len(refused) / total, "share refused with what to say"),
    ]
