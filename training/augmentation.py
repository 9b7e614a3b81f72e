"""Variation of renders while training: parts at any scale, mirrored, relit, noisy, blurred."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.second_look import Window

Image = NDArray[np.uint8]
Boxes = NDArray[np.float32]
_SHIPPED_SCALE = 0.5
_LEAST_SEEN, _LEAST_PX = 0.35, 5.0
_ANYWHERE, _ANYWHERE_PX = 0.06, (12.0, 150.0)  # share of the second looks at background, and their boxes' sides


@dataclass(frozen=True)
class Strength:
    """How far images are varied; 0 leaves them as they are."""

    scale: float = 1.0
    colour: float = 1.0


def part_of(
    rng: np.random.Generator,
    image: Image,
    boxes: Boxes,
    alikes: Boxes,
    size_px: tuple[int, int],
    strength: Strength,
) -> tuple[Image, Boxes]:
    """Return a varied part of a render as the detector would see it, `size_px` (width, height), and the boxes in it.

    Args:
        rng: random numbers.
        image: (h, w, 3) BGR.
        boxes: (M, 4) of the objects, counted from the image's corner [px].
        alikes: (K, 4) of look-alikes [px].
        size_px: of the part, in the detector's pixels.
        strength: how far to vary it. Half of the parts have the scale at which the detector runs on whole images, the
            others anything from farther away to a second look at full resolution.

    """
    (height, width), smallest = image.shape[:2], max(size_px[0] / image.shape[1], size_px[1] / image.shape[0])
    scale = _SHIPPED_SCALE
    if rng.random() < 0.5 * strength.scale:
        scale = float(np.exp(rng.uniform(np.log(max(smallest, 0.32)), 0.0)))
    w, h = min(round(size_px[0] / scale), width), min(round(size_px[1] / scale), height)
    x, y = _corner(rng, (width, height), (w, h), boxes, alikes)
    picture = np.asarray(cv2.resize(image[y : y + h, x : x + w], size_px, interpolation=cv2.INTER_LINEAR), np.uint8)
    factor = np.array([size_px[0] / w, size_px[1] / h] * 2, np.float32)
    inside = (np.clip(boxes - np.array([x, y, x, y], np.float32), 0, [w, h, w, h]) * factor).astype(np.float32)
    return _varied(rng, picture, inside, _share(inside / factor, boxes), strength)


def second_look_crop(
    rng: np.random.Generator,
    image: Image,
    boxes: Boxes,
    alikes: Boxes,
    size_px: tuple[int, int],
    strength: Strength,
) -> tuple[Image, Boxes]:
    """Return a varied second look at an object, look-alike or background, cropped as the detector does; see `part_of`.

    The window lies about a box with the errors of a first look.
    """
    choice = rng.random()
    if choice < _ANYWHERE or not len(boxes) + len(alikes):
        low, high = np.log(_ANYWHERE_PX)
        middle, half = rng.uniform((0, 0), image.shape[1::-1]), 0.5 * np.exp(rng.uniform(low, high, 2))
        box = np.concatenate([middle - half, middle + half])
    else:
        # As many look-alikes as objects: second looks are mostly at one of the two.
        among = boxes if not len(alikes) or (len(boxes) and choice < 0.5 * (1 + _ANYWHERE)) else alikes
        box = among[rng.integers(len(among))].astype(np.float64)
    size = box[2:] - box[:2]
    box = box + rng.normal(0, 1.0, 4) * np.tile(0.04 * size + 0.7, 2)
    middle, half = 0.5 * (box[:2] + box[2:]), 0.5 * np.maximum(box[2:] - box[:2], 4.0) * rng.uniform(0.9, 1.15)
    box = np.concatenate([middle - half, middle + half])
    window = Window.about(box - 0.5, (image.shape[1], image.shape[0]), size_px)
    picture = window.of(image)
    factor = 1.0 / window.scale
    inside = (boxes - np.array([window.x, window.y] * 2)) * factor
    inside = np.clip(inside, 0, [*size_px, *size_px]).astype(np.float32)
    return _varied(rng, picture, inside, _share(inside / factor, boxes), strength)


def _varied(
    rng: np.random.Generator, picture: Image, boxes: Boxes, seen: Boxes, strength: Strength
) -> tuple[Image, Boxes]:
    """Return a part, mirrored or not and relit, with its boxes of which enough is seen; `seen` (M,) are the shares."""
    boxes = boxes[(seen >= _LEAST_SEEN) & ((boxes[:, 2:] - boxes[:, :2]).min(1, initial=np.inf) >= _LEAST_PX)]
    if rng.random() < 0.5:
        width = picture.shape[1]
        picture = picture[:, ::-1]
        boxes = np.stack([width - boxes[:, 2], boxes[:, 1], width - boxes[:, 0], boxes[:, 3]], axis=1)
    if strength.colour:
        picture = _relit(rng, picture)
    return np.ascontiguousarray(picture), boxes


def _share(inside: Boxes, boxes: Boxes) -> Boxes:
    area = (inside[:, 2:] - inside[:, :2]).prod(1)
    return np.asarray(area / np.maximum((boxes[:, 2:] - boxes[:, :2]).prod(1), 1e-6))


def _corner(
    rng: np.random.Generator, image_px: tuple[int, int], part_px: tuple[int, int], boxes: Boxes, alikes: Boxes
) -> tuple[int, int]:
    """Choose a part mostly about an object, else about a look-alike; none that shows too little of an object."""
    whole, part = np.array(image_px), np.array(part_px)
    for _ in range(6):
        middle, choice = rng.uniform((0, 0), image_px), rng.random()
        if len(boxes) and choice < 0.5:
            box = boxes[rng.integers(len(boxes))]
            middle = 0.5 * (box[:2] + box[2:]) + rng.uniform(-0.42, 0.42, 2) * part
        elif len(alikes) and choice < 0.9:
            alike = alikes[rng.integers(len(alikes))]
            middle = 0.5 * (alike[:2] + alike[2:]) + rng.uniform(-0.42, 0.42, 2) * part
        x, y = (int(v) for v in np.clip(middle - part / 2, 0, whole - part))
        limits = [x, y, x + part_px[0], y + part_px[1]]
        share = _share(np.clip(boxes, limits[:2] * 2, limits[2:] * 2), boxes)
        if not ((share > 0.03) & (share < 0.5)).any():
            break
    return x, y


def _relit(rng: np.random.Generator, image: Image) -> Image:
    gains = np.exp(rng.normal(0, 0.18)) * np.exp(rng.normal(0, 0.04, 3))
    gamma = np.exp(rng.normal(0, 0.15))
    levels = np.arange(256, dtype=np.float32)[:, None] / 255.0
    table = np.clip(255 * levels**gamma * gains.astype(np.float32) + rng.normal(0, 4), 0, 255).astype(np.uint8)
    image = np.asarray(cv2.LUT(np.ascontiguousarray(image), table.reshape(256, 1, 3)))
    if rng.random() < 0.1:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), rng.uniform(0.3, 0.8)))
    if rng.random() < 0.3:
        noise = rng.standard_normal(image.shape, dtype=np.float32) * np.float32(rng.uniform(1, 5))
        image = np.clip(image + noise, 0, 255).astype(np.uint8)
    return image
