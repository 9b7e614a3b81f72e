"""Points of a photograph to click on: spread over the picture, each where there is texture in every direction."""

import math

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8]

_WIDTH_PX = 640
_NEIGHBOURHOOD_PX = 21
_BLUR_PX = 1.5
_LEAST_GRADIENT = 1.5
_MARGIN, _LEFT_MARGIN = 0.1, 0.15
_APART = 0.12


def click_points(photograph: Image, count: int) -> list[tuple[int, int]]:
    """Return up to `count` pixels (x, y) of a left photograph (h, w, 3) BGR, row by row; none where it has no texture.

    The picture is divided into `count` cells or a few more, and each gives the point that has the most texture around
    it. A border is left out: what lies at the left one is not in the right photograph.
    """
    height, width = photograph.shape[:2]
    scale = min(1.0, _WIDTH_PX / width)
    small = cv2.resize(photograph, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    texture = least_gradient(np.asarray(small, np.uint8))
    rows = max(1, round(math.sqrt(count * height / width)))
    columns = math.ceil(count / rows)
    xs = np.linspace(_LEFT_MARGIN, 1.0 - _MARGIN, columns + 1) * texture.shape[1]
    ys = np.linspace(_MARGIN, 1.0 - _MARGIN, rows + 1) * texture.shape[0]
    cells = [(int(y), int(below), int(x), int(beyond)) for y, below in _between(ys) for x, beyond in _between(xs)]
    found: list[tuple[float, float, float]] = []
    for top, bottom, left, right in cells:
        best = _best(texture, (top, bottom, left, right), [(x, y) for x, y, _ in found])
        if best is not None:
            found.append(best)
    # More cells than points: the weakest go.
    for _ in range(len(found) - count):
        found.remove(min(found, key=lambda point: point[2]))
    return [(round(x / scale), round(y / scale)) for x, y, _ in found]


def least_gradient(image: Image) -> Array:
    """Return the RMS gradient (h, w) in the direction in which it is least, within 21 px, of an image (h, w, 3) BGR.

    In grey levels per px. An edge has none along itself, so that it alone does not count as texture.
    """
    grey = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float64), (0, 0), _BLUR_PX)
    down, across = np.gradient(grey)
    window = (_NEIGHBOURHOOD_PX, _NEIGHBOURHOOD_PX)
    xx, xy, yy = (cv2.blur(product, window) for product in (across * across, across * down, down * down))
    least = 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)
    return np.asarray(np.sqrt(np.maximum(least, 0.0)), np.float64)


def _best(
    texture: Array, cell: tuple[int, int, int, int], others: list[tuple[float, float]]
) -> tuple[float, float, float] | None:
    """Return x, y and texture of a cell's best point apart from the others, if there is texture at all."""
    top, bottom, left, right = cell
    part = texture[top:bottom, left:right].copy()
    if part.size == 0:
        return None
    y, x = np.mgrid[top:bottom, left:right]
    for other_x, other_y in others:
        part[np.hypot(x - other_x, y - other_y) < _APART * texture.shape[1]] = 0.0
    row, column = np.unravel_index(int(part.argmax()), part.shape)
    value = float(part[row, column])
    return (float(left + column), float(top + row), value) if value >= _LEAST_GRADIENT else None


def _between(limits: Array) -> list[tuple[float, float]]:
    return list(zip(limits[:-1].tolist(), limits[1:].tolist(), strict=True))
