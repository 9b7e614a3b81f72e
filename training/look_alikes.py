"""Objects with the colours, shape or pattern of a Rubik's cube, which a detector must not detect."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from training.textures import cloud, collage
from vergence_sim.pictures import CUBE_COLOURS_BGR, cube_faces

Image = NDArray[np.uint8]
_SIZE_PX = 96


def _colour(rng: np.random.Generator) -> tuple[int, int, int]:
    return CUBE_COLOURS_BGR[int(rng.integers(len(CUBE_COLOURS_BGR)))]


def _plain(rng: np.random.Generator) -> Image:
    return np.full((_SIZE_PX, _SIZE_PX, 3), _colour(rng), np.uint8)


def _stripes(rng: np.random.Generator) -> Image:
    image = np.empty((_SIZE_PX, _SIZE_PX, 3), np.uint8)
    width = _SIZE_PX // int(rng.integers(3, 8))
    for start in range(0, _SIZE_PX, width):
        image[:, start : start + width] = _colour(rng)
    return image if rng.random() < 0.5 else np.ascontiguousarray(image.transpose(1, 0, 2))


def _dots(rng: np.random.Generator) -> Image:
    """A die in the cube's colours."""
    image, ink = _plain(rng), _colour(rng)
    step = _SIZE_PX // 3
    for row in range(3):
        for column in range(3):
            if rng.random() < 0.6:
                centre = (column * step + step // 2, row * step + step // 2)
                cv2.circle(image, centre, step // 4, ink, -1, cv2.LINE_AA)
    return image


def _checks(rng: np.random.Generator) -> Image:
    """A chessboard of two tones, never 3x3 fields."""
    fields = int(rng.choice([2, 4, 6, 8]))
    light, dark = _colour(rng), tuple(int(v) for v in rng.integers(0, 70, 3))
    cells = np.indices((fields, fields)).sum(0) % 2
    small = np.where(cells[:, :, None] == 0, np.array(light, np.uint8), np.array(dark, np.uint8))
    return np.asarray(cv2.resize(small, (_SIZE_PX, _SIZE_PX), interpolation=cv2.INTER_NEAREST))


def _label(rng: np.random.Generator) -> Image:
    """A carton: one colour, a frame, a word."""
    image = _plain(rng)
    cv2.rectangle(image, (8, 8), (_SIZE_PX - 9, _SIZE_PX - 9), _colour(rng), int(rng.integers(2, 8)))
    word = "".join(chr(int(c)) for c in rng.integers(65, 91, 4))
    cv2.putText(image, word, (12, _SIZE_PX // 2 + 8), cv2.FONT_HERSHEY_DUPLEX, 0.8, _colour(rng), 2, cv2.LINE_AA)
    return image


def _bricks(rng: np.random.Generator) -> Image:
    """Two by two or a row of blocks with dark gaps: toy bricks."""
    rows, columns = ((1, 2), (2, 1), (1, 3), (3, 1))[int(rng.integers(4))]
    image = np.full((_SIZE_PX, _SIZE_PX, 3), 18, np.uint8)
    for row in range(rows):
        for column in range(columns):
            top, left = row * _SIZE_PX // rows + 4, column * _SIZE_PX // columns + 4
            bottom, right = (row + 1) * _SIZE_PX // rows - 5, (column + 1) * _SIZE_PX // columns - 5
            cv2.rectangle(image, (left, top), (right, bottom), _colour(rng), -1)
    return image


def _collage(rng: np.random.Generator) -> Image:
    return collage(rng, _SIZE_PX, 25)


PATTERNS: dict[str, Callable[[np.random.Generator], Image]] = {
    "plain": _plain,
    "stripes": _stripes,
    "dots": _dots,
    "checks": _checks,
    "label": _label,
    "bricks": _bricks,
    "collage": _collage,
}

PUZZLES = {"puzzle of 2": 2, "puzzle of 4": 4, "puzzle of 5": 5}
"""Cells a side."""

KINDS = (*PATTERNS, *PUZZLES)

SMALLEST_PX = {
    "plain": 6.5,
    "label": 6.5,
    "dots": 12.0,
    "checks": 12.0,
    "stripes": 14.0,
    "bricks": 16.0,
    "collage": 16.0,
    "puzzle of 2": 20.0,
    "puzzle of 4": 26.0,
    "puzzle of 5": 30.0,
}
"""Width [px at 320] from which each is distinguishable from a Rubik's cube; smaller ones are not placed."""


def faces(rng: np.random.Generator, kind: str) -> list[Image]:
    """Return six worn faces (n, n, 3) of one kind of look-alike."""
    if kind in PUZZLES:
        return cube_faces(rng, PUZZLES[kind], 128)
    make = PATTERNS[kind]
    return [
        np.clip(make(rng).astype(np.float32) + cloud(rng, _SIZE_PX, 5, 0.8)[:, :, None] * 6, 0, 255).astype(np.uint8)
        for _ in range(6)
    ]
