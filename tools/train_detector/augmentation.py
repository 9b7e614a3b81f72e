"""Variation of renders while training: mirrored, shifted, scaled, relit, noisy, blurred."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Boxes = NDArray[np.float32]
_GREY = (114, 114, 114)


@dataclass(frozen=True)
class Strength:
    """How far images are varied; 0 leaves them as they are."""

    geometry: float = 1.0
    colour: float = 1.0


def vary(rng: np.random.Generator, image: Image, boxes: Boxes, strength: Strength) -> tuple[Image, Boxes]:
    """Return a varied copy of an image (h, w, 3) BGR and of its boxes (M, 4), counted from its corner [px].

    Boxes of which less than 60 % stays inside go, with the little that is seen of them left as it is.
    """
    if rng.random() < 0.5:
        image, boxes = (
            image[:, ::-1],
            np.stack([image.shape[1] - boxes[:, 2], boxes[:, 1], image.shape[1] - boxes[:, 0], boxes[:, 3]], axis=1),
        )
    if strength.geometry and rng.random() < 0.6 * strength.geometry:
        image, boxes = _moved(rng, image, boxes)
    if strength.colour:
        image = _relit(rng, image)
    return np.ascontiguousarray(image), boxes


def crop(rng: np.random.Generator, image: Image, boxes: Boxes, size_px: tuple[int, int]) -> tuple[Image, Boxes]:
    """Return a part of `size_px` (width, height) of an image and the boxes in it, mostly about one of its objects.

    A box of which hardly anything stays inside goes; a place where that is neither all nor nothing is avoided.
    """
    (height, width), (w, h) = image.shape[:2], size_px
    for _ in range(6):
        middle = rng.uniform((0, 0), (width, height))
        if len(boxes) and rng.random() < 0.7:
            box = boxes[rng.integers(len(boxes))]
            middle = 0.5 * (box[:2] + box[2:]) + rng.uniform(-0.45, 0.45, 2) * size_px
        x, y = (
            int(np.clip(m - s / 2, 0, side - s)) for m, s, side in zip(middle, size_px, (width, height), strict=True)
        )
        inside = np.clip(boxes - np.array([x, y, x, y], np.float32), 0, [w, h, w, h]).astype(np.float32)
        share = (inside[:, 2:] - inside[:, :2]).prod(1) / np.maximum((boxes[:, 2:] - boxes[:, :2]).prod(1), 1e-6)
        if not ((share > 0.03) & (share < 0.5)).any():
            break
    kept = (share >= 0.35) & ((inside[:, 2:] - inside[:, :2]).min(1, initial=np.inf) >= 4)
    return np.ascontiguousarray(image[y : y + h, x : x + w]), inside[kept]


def _moved(rng: np.random.Generator, image: Image, boxes: Boxes) -> tuple[Image, Boxes]:
    height, width = image.shape[:2]
    scale = float(np.exp(rng.uniform(np.log(0.7), np.log(1.5))))
    dx, dy = rng.uniform(-0.1, 0.1) * width, rng.uniform(-0.1, 0.1) * height
    x0, y0 = (1 - scale) * width / 2 + dx, (1 - scale) * height / 2 + dy
    # Boxes count from the image's corner, warpAffine from the first pixel's centre.
    matrix = np.array([[scale, 0, x0 + 0.5 * scale - 0.5], [0, scale, y0 + 0.5 * scale - 0.5]])
    flags = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    moved = cv2.warpAffine(image, matrix, (width, height), flags=flags, borderValue=_GREY)
    placed = boxes * scale + np.array([x0, y0, x0, y0], np.float32)
    inside = np.clip(placed, 0, [width, height, width, height]).astype(np.float32)
    share = (inside[:, 2:] - inside[:, :2]).prod(1) / np.maximum((placed[:, 2:] - placed[:, :2]).prod(1), 1e-6)
    if ((share < 0.6) & (share > 0.05)).any():
        return image, boxes
    kept = (share >= 0.6) & ((inside[:, 2:] - inside[:, :2]).min(1) >= 4)
    if (~kept & (share > 0.05)).any():
        return image, boxes
    return np.asarray(moved, np.uint8), inside[kept]


def _relit(rng: np.random.Generator, image: Image) -> Image:
    gains = np.exp(rng.normal(0, 0.18)) * np.exp(rng.normal(0, 0.04, 3))
    gamma = np.exp(rng.normal(0, 0.15))
    levels = np.arange(256, dtype=np.float32)[:, None] / 255.0
    table = np.clip(255 * levels**gamma * gains.astype(np.float32) + rng.normal(0, 4), 0, 255).astype(np.uint8)
    image = np.asarray(cv2.LUT(np.ascontiguousarray(image), table.reshape(256, 1, 3)))
    if rng.random() < 0.15:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.3, 0.9)))
    if rng.random() < 0.3:
        noise = rng.standard_normal(image.shape, dtype=np.float32) * np.float32(rng.uniform(1, 5))
        image = np.clip(image + noise, 0, 255).astype(np.uint8)
    return image
