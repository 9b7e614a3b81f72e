"""The picture of a model's first run: areas, edges, gradients and texture, so that its outputs differ by place."""

import cv2
import numpy as np
from numpy.typing import NDArray

_TEXTURE = 40.0
_SEED = 20


def warm_up_picture(size_px: tuple[int, int]) -> NDArray[np.uint8]:
    """Return a BGR picture (h, w, 3) of (width, height), always the same."""
    width, height = size_px
    y, x = np.mgrid[0:height, 0:width]
    ramp = np.stack([255.0 * x / width, 255.0 * y / height, 255.0 * (1.0 - x / width)], axis=2)
    texture = np.random.default_rng(_SEED).normal(0.0, _TEXTURE, (height, width, 3))
    picture = np.clip(0.7 * ramp + texture, 0, 255).astype(np.uint8)
    side = min(width, height)
    for i, (across, down) in enumerate(((0.2, 0.3), (0.5, 0.6), (0.8, 0.3), (0.3, 0.8))):
        colour = (230 * (i % 2), 60 + 50 * i, 200 - 50 * i)
        centre = (round(across * width), round(down * height))
        cv2.ellipse(picture, centre, (side // (6 + i), side // (8 + i)), 25.0 * i, 0, 360, colour, -1)
    return picture
