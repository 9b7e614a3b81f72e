"""The overlay picture of both eyes: every detection, the target's pair, and metric II's figures."""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box, Detections
from vergence_metric.boxes.result import BoxStatus, BoxVergenceResult

_TARGET_BGR, _OTHER_BGR, _UNCERTAIN_BGR = (80, 220, 80), (200, 170, 60), (40, 160, 255)
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def draw(left: NDArray[Any], right: NDArray[Any], result: BoxVergenceResult) -> NDArray[np.uint8]:
    """Return both images (h, w, 3) or (h, w) side by side, (h, 2 w, 3) BGR: the target green, orange if not OK."""
    width = left.shape[1]
    picture = np.hstack([_colour(left), _colour(right)])
    ink = _TARGET_BGR if result.status is BoxStatus.OK else _UNCERTAIN_BGR
    views: tuple[tuple[Detections, Box | None, int], ...] = (
        (result.left_detections, result.left, 0),
        (result.right_detections, result.right, width),
    )
    for detections, target, shift in views:
        for box in detections:
            _frame(picture, box, shift, _OTHER_BGR, 1)
        if target is not None:
            _frame(picture, target, shift, ink, 2)
    if result.left is not None and result.right is not None:
        # The left box once more in the right view: what separates the two is the metric.
        _frame(picture, result.left, width, ink, 1, named=False)
    for row, text in enumerate(overlay_lines(result)):
        (wide, high), _ = cv2.getTextSize(text, _FONT, 0.42, 1)
        x, y = 6, 16 + 15 * row
        # A ground of its own: OpenCV 5 spaces a broader outline of the same text differently.
        cv2.rectangle(picture, (x - 3, y - high - 2), (x + wide + 3, y + 4), (0, 0, 0), -1)
        cv2.putText(picture, text, (x, y), _FONT, 0.42, (255, 255, 255), 1, cv2.LINE_AA)
    return picture


def overlay_lines(result: BoxVergenceResult) -> list[str]:
    """Return the lines of text: what is seen, corner differences both ways, disparities."""
    if result.status is BoxStatus.OK:
        lines = [result.class_name]
    else:
        lines = [f"{result.class_name or 'no target'}: {result.reason}"]
    there, back = result.corners.left_minus_right_px, result.corners.right_minus_left_px
    for name, x, y in (("top left", 0, 1), ("bottom right", 2, 3)):
        lines.append(f"{name}: {_figure(there[x])} {_figure(there[y])} >  {_figure(back[x])} {_figure(back[y])} <")
    lines.append(f"centre {_figure(result.center_px[0])} px, surface {_figure(result.refined.horizontal_px)} px")
    return lines


def _frame(
    picture: NDArray[np.uint8], box: Box, shift: int, ink: tuple[int, int, int], width: int, named: bool = True
) -> None:
    x_min, y_min, x_max, y_max = (round(value) for value in box.xyxy_px)
    cv2.rectangle(picture, (x_min + shift, y_min), (x_max + shift, y_max), ink, width)
    for x, y in box.landmarks_px:
        cv2.circle(picture, (round(x) + shift, round(y)), 1, ink, -1)
    if named:
        place = (x_min + shift, max(y_min - 4, 10))
        cv2.putText(picture, f"{box.class_name} {box.score:.2f}", place, _FONT, 0.4, ink, 1, cv2.LINE_AA)


def _colour(image: NDArray[Any]) -> NDArray[np.uint8]:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image, np.uint8)


def _figure(value: float) -> str:
    return f"{value:+.1f}" if math.isfinite(value) else "-"
