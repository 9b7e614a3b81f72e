"""The picture at the top of the demo's report: every station before and at vergence, at the middle of the images."""

import math
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from vergence_bringup.demo.result import StationResult
from vergence_bringup.figures.pictures import Image, PictureError, read_image, write_image

FILE = "overview.png"
CAPTION = (
    "Every station: what the left eye saw at the end, and the edges of both eyes there (left red, right cyan, both "
    "white) before and at the end"
)

_TILE_PX = 180
_CROP_PX = 220
_COLUMNS = 2
_GAP_PX, _STRIP_PX = 8, 22
_GOOD_BGR, _BAD_BGR, _PAPER = (61, 128, 23), (30, 38, 179), 255
_PARTS = (("end_left", "jpg"), ("start_combined", "png"), ("end_combined", "png"))


def write_overview(results: Sequence[StationResult], pictures: Path) -> bool:
    """Write the picture from those of the stations, two stations a row; False where no station has any."""
    shown = [_middles(result.name, pictures) for result in results]
    if not any(middles is not None for middles in shown):
        return False
    tiles = [_tile(result, middles) for result, middles in zip(results, shown, strict=True)]
    tiles += [np.full_like(tiles[0], _PAPER)] * (-len(tiles) % _COLUMNS)
    rows = [np.hstack(tiles[first : first + _COLUMNS]) for first in range(0, len(tiles), _COLUMNS)]
    write_image(pictures / FILE, np.vstack(rows))
    return True


def _middles(name: str, pictures: Path) -> list[Image] | None:
    """Return the middles of a station's pictures; None where they are missing: it was not completed."""
    try:
        return [_middle(read_image(pictures / f"{name}_{part}.{suffix}")) for part, suffix in _PARTS]
    except PictureError:
        return None


def _tile(result: StationResult, middles: list[Image] | None) -> Image:
    """Return a station's pictures side by side under its verdict."""
    side = _TILE_PX + _GAP_PX
    tile = np.full((_STRIP_PX + side, len(_PARTS) * side, 3), _PAPER, np.uint8)
    for number, middle in enumerate(middles or ()):
        tile[_STRIP_PX : _STRIP_PX + _TILE_PX, number * side : number * side + _TILE_PX] = middle
    colour = _GOOD_BGR if result.passed else _BAD_BGR
    cv2.putText(tile, _verdict(result), (2, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, 1, cv2.LINE_AA)
    return tile


def _middle(picture: Image) -> Image:
    height, width = picture.shape[:2]
    half = min(_CROP_PX, height, width) // 2
    crop = picture[height // 2 - half : height // 2 + half, width // 2 - half : width // 2 + half]
    return np.asarray(cv2.resize(crop, (_TILE_PX, _TILE_PX), interpolation=cv2.INTER_AREA), np.uint8)


def _verdict(result: StationResult) -> str:
    if not result.reported_verged:
        return f"{result.name}: not verged"
    error = f"{result.true_error_deg:.2f} deg off" if math.isfinite(result.true_error_deg) else "verged"
    return f"{result.name}: {error}, {result.time_s:.2f} s"
