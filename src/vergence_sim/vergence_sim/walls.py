"""Walls as pictures: what they are made of, paintings, posters and a window on them, shadows and dusk."""

from collections.abc import Callable

import cv2
import numpy as np

from vergence_sim.pictures import painting, poster, window_view
from vergence_sim.surfaces import Image

PX_PER_M = 330
Face = Callable[[np.random.Generator, tuple[int, int]], Image]
"""Draws a picture of (height, width) in pixels by a generator."""


def wall(rng: np.random.Generator, size_m: tuple[float, float], base: Face, first: list[Face]) -> Image:
    """Return a wall of (width, height) with pictures hung on it, their shadows, and the dusk of its corners.

    `base` is what it is made of; `first` are pictures that are hung first.
    """
    width, height = (round(side * PX_PER_M) for side in size_m)
    made = base(rng, (height, width)).astype(np.float32)
    taken: list[tuple[int, int, int, int]] = []
    wanted: list[Face] = [*first, *(painting if rng.random() < 0.6 else poster for _ in range(9))]
    for picture in wanted:
        tall = 1.0 if picture is window_view else float(rng.uniform(0.28, 0.6))
        across = tall * (1.25 if picture is window_view else float(rng.uniform(0.65, 1.4)))
        h, w = round(tall * PX_PER_M), round(across * PX_PER_M)
        for _ in range(12):
            x, y = int(rng.integers(30, width - w - 30)), int(rng.uniform(0.12, 0.6) * height)
            if y + h < height - 30 and all(
                x > r + 20 or x + w + 20 < left or y > b + 20 or y + h + 20 < top for left, top, r, b in taken
            ):
                taken.append((x, y, x + w, y + h))
                _hang(made, picture(rng, (h, w)), x, y)
                break
    made *= _dusk(height, width)[:, :, None]
    return np.clip(made, 0, 255).astype(np.uint8)


def _hang(onto: np.ndarray, picture: Image, x: int, y: int) -> None:
    height, width = picture.shape[:2]
    shade = np.ones(onto.shape[:2], np.float32)
    cv2.rectangle(shade, (x + 2, y + 4), (x + width + 5, y + height + 9), 0.62, -1)
    onto *= cv2.GaussianBlur(shade, (0, 0), 4)[:, :, None]
    onto[y : y + height, x : x + width] = picture


def _dusk(height: int, width: int) -> np.ndarray:
    x = np.minimum(np.arange(width), np.arange(width)[::-1]) / (0.35 * PX_PER_M)
    y = np.minimum(np.arange(height), np.arange(height)[::-1]) / (0.35 * PX_PER_M)
    return np.asarray((1 - 0.35 * np.exp(-x))[None, :] * (1 - 0.35 * np.exp(-y))[:, None], np.float32)
