"""Images of pairs and their edges, for files and reports."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from vergence_rig.picture_file import read_picture
from vergence_rig.regular_file import FileError, expanded

Image = npt.NDArray[np.uint8]

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_INK_BGR = (80, 230, 80)


class PictureError(ValueError):
    """An image cannot be read or written."""


def read_image(path: Path) -> Image:
    """Return an image file as (h, w, 3) BGR uint8; raises PictureError where it cannot be decoded."""
    try:
        return read_picture(path)
    except FileError as error:
        raise PictureError(f"image {path} {error}") from error


def write_image(path: Path, image: npt.NDArray[Any]) -> None:
    """Write an image and create its folder; raises PictureError where that fails."""
    path = expanded(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(path), image):
        raise PictureError(f"image {path}: cannot be written")


def combined_edges(left_mask: npt.NDArray[Any], right_mask: npt.NDArray[Any]) -> Image:
    """Return both edge masks (h, w) in one BGR image: left red, right cyan, both white."""
    picture = np.zeros((*left_mask.shape, 3), np.uint8)
    picture[left_mask > 0, 2] = 255
    picture[right_mask > 0, :2] = 255
    return picture


def with_windows(picture: Image, windows_px: Sequence[int]) -> Image:
    """Return a copy with the outlines of the centre windows drawn on it."""
    framed = picture.copy()
    height, width = framed.shape[:2]
    for size in windows_px:
        row, column = height // 2 - size // 2, width // 2 - size // 2
        cv2.rectangle(framed, (column, row), (column + size - 1, row + size - 1), (90, 200, 90), 1)
    return framed


def with_cross(picture: Image, at_px: tuple[float, float] | None = None) -> Image:
    """Return a copy with a cross at a pixel (x, y), the image's centre where none is given."""
    marked = picture.copy()
    centre = (marked.shape[1] // 2, marked.shape[0] // 2) if at_px is None else (round(at_px[0]), round(at_px[1]))
    cv2.drawMarker(marked, centre, (0, 0, 0), cv2.MARKER_CROSS, 25, 3)
    cv2.drawMarker(marked, centre, (80, 255, 255), cv2.MARKER_CROSS, 23, 1)
    return marked


def with_ring(picture: Image, at_px: tuple[float, float], label: str = "") -> Image:
    """Return a copy with a ring around a pixel (x, y) and a label beside it; without them where the pixel is NaN."""
    marked = picture.copy()
    if not all(map(math.isfinite, at_px)):
        return marked
    centre = (round(at_px[0]), round(at_px[1]))
    for colour, thickness in (((0, 0, 0), 4), (_INK_BGR, 2)):
        cv2.circle(marked, centre, 9, colour, thickness, cv2.LINE_AA)
    if label:
        _write(marked, label, (centre[0] + 14, centre[1] - 6))
    return marked


def with_box(picture: Image, xyxy_px: Sequence[float], label: str) -> Image:
    """Return a copy with a box (x_min, y_min, x_max, y_max) and its label drawn on it."""
    marked = picture.copy()
    x_min, y_min, x_max, y_max = (round(value) for value in xyxy_px)
    cv2.rectangle(marked, (x_min, y_min), (x_max, y_max), (0, 0, 0), 3)
    cv2.rectangle(marked, (x_min, y_min), (x_max, y_max), _INK_BGR, 1)
    _write(marked, label, (x_min, y_min - 6))
    return marked


def _write(picture: Image, label: str, at_px: tuple[int, int]) -> None:
    """Write a label into a picture, its lower left corner at a pixel (x, y) or as near as it fits."""
    (width, height), _ = cv2.getTextSize(label, _FONT, 0.42, 1)
    x, y = at_px[0], max(at_px[1], height + 3)
    # A filled background: OpenCV 5 spaces an outline of the same text differently.
    cv2.rectangle(picture, (x - 2, y - height - 3), (x + width + 2, y + 3), (0, 0, 0), -1)
    cv2.putText(picture, label, (x, y), _FONT, 0.42, _INK_BGR, 1, cv2.LINE_AA)
