"""A picture of a pair for people: the left view with both eyes' edges, the windows and the values of the metric."""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity import Disparity
from vergence_metric.measurement.edge_metric import EdgeMetricResult

LEFT_BGR = (80, 220, 80)
RIGHT_BGR = (255, 120, 60)
BOTH_BGR = (255, 255, 255)
WINDOW_BGR = (0, 200, 255)
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def draw_overlay(left: NDArray[Any], result: EdgeMetricResult, disparity: Disparity) -> NDArray[np.uint8]:
    """Return a (h, w, 3) BGR picture of the left view, darkened: left edges green, right edges blue, common ones white.

    An arrow from the fovea to the same point in the right image shows the disparity; one line of text per window gives
    the metric in both directions.
    """
    colour = cv2.cvtColor(left, cv2.COLOR_GRAY2BGR) if left.ndim == 2 else left
    picture = np.right_shift(colour, 1, dtype=np.uint8)
    in_left, in_right = result.left_edges.mask > 0, result.right_edges.mask > 0
    picture[in_left] = LEFT_BGR
    picture[in_right] = RIGHT_BGR
    picture[in_left & in_right] = BOTH_BGR
    for window in result.windows:
        cv2.rectangle(picture, (window.left, window.top), (window.right - 1, window.bottom - 1), WINDOW_BGR, 1)
    if math.isfinite(disparity.horizontal_px):
        fovea = tuple(round(value) for value in disparity.point_px)
        matched = (round(disparity.point_px[0] - disparity.horizontal_px), fovea[1])
        cv2.arrowedLine(picture, fovea, matched, (60, 60, 255), 2, tipLength=0.2)
    for row, text in enumerate(overlay_lines(result, disparity)):
        (wide, high), _ = cv2.getTextSize(text, _FONT, 0.42, 1)
        x, y = 6, 16 + 15 * row
        # A filled background: OpenCV 5 spaces a broader outline of the same text differently.
        cv2.rectangle(picture, (x - 3, y - high - 2), (x + wide + 3, y + 4), (0, 0, 0), -1)
        cv2.putText(picture, text, (x, y), _FONT, 0.42, (255, 255, 255), 1, cv2.LINE_AA)
    return picture


def overlay_lines(result: EdgeMetricResult, disparity: Disparity) -> list[str]:
    """Return the lines of text: the signed error, then each window's metric."""
    if math.isfinite(disparity.horizontal_px):
        error = f"error {disparity.horizontal_px:+.1f} px, {disparity.confidence:.0%} confidence"
    else:
        error = f"error unknown: {disparity.reason}"
    lines = [error]
    for window, there, back in zip(result.windows, result.left_to_right_px, result.right_to_left_px, strict=True):
        lines.append(f"{window.size_px:4d} px: {_value(there)} > {_value(back)} <")
    return lines


def _value(value: float) -> str:
    return f"{value:6.2f}" if math.isfinite(value) else "     -"
