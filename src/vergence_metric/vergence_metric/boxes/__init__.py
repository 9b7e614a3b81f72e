"""Metric II: a target's boxes in both eyes, found by a detector, paired, measured, refined and placed in space."""

from vergence_metric.boxes.box_overlay import draw
from vergence_metric.boxes.detections import Box, Detections
from vergence_metric.boxes.detector import Detector
from vergence_metric.boxes.errors import DetectorError
from vergence_metric.boxes.measurement import BoxMeasurement, measure_pair
from vergence_metric.boxes.result import BoxStatus, BoxVergenceResult

__all__ = [
    "Box",
    "BoxMeasurement",
    "BoxStatus",
    "BoxVergenceResult",
    "Detections",
    "Detector",
    "DetectorError",
    "draw",
    "measure_pair",
]
