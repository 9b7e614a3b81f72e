"""Portraits on the boards that stand for persons: head and shoulders, each of another person.

Every function returns (h, w, 3) uint8 BGR, the same for the same generator and the same installed packages.
"""

import importlib

import cv2
import numpy as np

from vergence_sim.surfaces import Image, cloth, grain, muted, shaded

_SKIN_BGR = ((150, 185, 235), (110, 150, 205), (70, 105, 160), (45, 70, 110))
_HAIR_BGR = ((35, 40, 50), (40, 80, 130), (120, 190, 215), (160, 165, 170))
_ASTRONAUT_ROWS, _ASTRONAUT_COLUMNS = slice(0, 340), slice(100, 350)


def portrait(number: int, seed: int, size_px: tuple[int, int] = (330, 242)) -> Image:
    """Return the portrait of person `number`, from 0, of a world of this seed; `size_px` is (height, width).

    The first is scikit-image's astronaut where that is installed, the others are drawn.
    """
    astronaut = _astronaut() if number == 0 else None
    if astronaut is not None:
        return np.asarray(cv2.resize(astronaut, size_px[::-1], interpolation=cv2.INTER_AREA), np.uint8)
    return drawn_portrait(np.random.default_rng([seed, 11, number]), size_px)


def drawn_portrait(rng: np.random.Generator, size_px: tuple[int, int]) -> Image:
    """Return a drawn person before a plain wall: hair, face, neck and a patterned shirt."""
    height, width = size_px
    canvas = shaded(muted(rng, 120, 210, 20), grain(rng, size_px) * 6).astype(np.float32)
    skin, hair = (np.array(table[rng.integers(len(table))], float) for table in (_SKIN_BGR, _HAIR_BGR))
    skin, hair = skin + rng.normal(0, 10, 3), hair + rng.normal(0, 8, 3)

    def at(x: float, y: float) -> tuple[int, int]:
        return round(x * width), round(y * height)

    def oval(x: float, y: float, half_x: float, half_y: float, colour: np.ndarray, turn_deg: float = 0.0) -> None:
        axes = max(round(half_x * width), 1), max(round(half_y * height), 1)
        cv2.ellipse(canvas, at(x, y), axes, turn_deg, 0, 360, colour.tolist(), -1, cv2.LINE_AA)

    shirt = cloth(rng, size_px, muted(rng, 40, 190, 70)).astype(np.float32)
    body = np.zeros(size_px, np.uint8)
    cv2.ellipse(body, at(0.5, 1.08), (round(0.48 * width), round(0.32 * height)), 0, 0, 360, 255, -1)
    canvas[body > 0] = shirt[body > 0]
    half_x, half_y = 0.24 + float(rng.normal(0, 0.015)), 0.25 + float(rng.normal(0, 0.015))
    if rng.random() < 0.5:
        oval(0.5, 0.46, half_x + 0.08, half_y + 0.1, hair)  # long hair
    oval(0.5, 0.72, 0.1, 0.14, 0.9 * skin)
    oval(0.5, 0.37, half_x + 0.03, half_y + 0.02, hair)
    oval(0.5, 0.44, half_x, half_y, skin)
    oval(0.5, 0.5, 0.7 * half_x, 0.6 * half_y, 1.05 * skin)
    apart, eyes_y = 0.095 + float(rng.normal(0, 0.006)), 0.42
    iris = np.array([rng.uniform(40, 150), rng.uniform(50, 100), rng.uniform(30, 70)])
    for side in (-1.0, 1.0):
        x = 0.5 + side * apart
        oval(x, eyes_y, 0.046, 0.02, np.array([235.0, 238.0, 240.0]))
        oval(x, eyes_y, 0.02, 0.017, iris)
        oval(x, eyes_y, 0.009, 0.008, np.full(3, 15.0))
        oval(x, eyes_y - 0.05, 0.055, 0.009, 0.8 * hair, side * float(rng.uniform(2, 12)))
    oval(0.5, 0.5, 0.025, 0.04, 0.85 * skin)
    oval(0.5, 0.585, 0.075, 0.016 + float(rng.uniform(0, 0.008)), np.array([90.0, 80.0, 180.0]))
    if rng.random() < 0.4:
        for side in (-1.0, 1.0):
            cv2.circle(canvas, at(0.5 + side * apart, eyes_y), round(0.075 * width), (30, 30, 30), 2, cv2.LINE_AA)
    return np.clip(canvas + 3.0 * grain(rng, size_px)[..., None], 0, 255).astype(np.uint8)


def _astronaut() -> Image | None:
    """Return scikit-image's portrait of an astronaut, None where it is not installed."""
    try:
        picture = importlib.import_module("skimage.data").astronaut()
    except (ImportError, OSError):
        return None
    return np.ascontiguousarray(picture[_ASTRONAUT_ROWS, _ASTRONAUT_COLUMNS, ::-1])
