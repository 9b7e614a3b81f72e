"""Pairs of images whose disparity at the centre is known, and pairs that have none: for the disparity benchmark.

A texture is drawn at twice the images' resolution, band-limited, and both eyes sample it: shifts are real, nothing is
cyclic. Its mean absolute gradient at the centre (41 px window, across) is at least `MINIMUM_GRADIENT`.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Grey = NDArray[np.float32]

WIDTH, HEIGHT = 640, 480
MINIMUM_GRADIENT = 3.0
_SIZE = 1700
_MIDDLE = (_SIZE - 1) / 2
_POOL = 48


@dataclass(frozen=True)
class Pair:
    """Two images; `disparity_px` is x_left - x_right at the left image's centre, None where there is none to find."""

    left: Image
    right: Image
    disparity_px: float | None


def texture(rng: np.random.Generator) -> Grey:
    """Draw a texture of random coarseness with enough gradient at its centre."""
    while True:
        finest = rng.uniform(1.8, 5.0)
        grey = np.zeros((_SIZE, _SIZE), np.float32)
        for octave in range(4):
            small = _SIZE // 2**octave
            layer = rng.standard_normal((small, small), np.float32)
            layer = cv2.GaussianBlur(layer, (0, 0), finest)
            grey += cv2.resize(layer, (_SIZE, _SIZE), interpolation=cv2.INTER_CUBIC)
        grey = 128 + rng.uniform(25, 50) * (grey - grey.mean()) / grey.std()
        middle = int(_MIDDLE)
        window = grey[middle - 41 : middle + 41 : 2, middle - 41 : middle + 41 : 2]
        if float(np.abs(np.diff(window, axis=1)).mean()) >= MINIMUM_GRADIENT:
            return grey


def view(
    grey: Grey,
    rng: np.random.Generator,
    shift_px: float = 0.0,
    vertical_px: float = 0.0,
    roll_deg: float = 0.0,
    gain: float = 1.0,
    noise: float = 0.0,
) -> Image:
    """Sample the texture, shifted by (x_left - x_right, y_left - y_right) at the centre and rolled about it."""
    x = np.arange(WIDTH)[None, :] - (WIDTH - 1) / 2 + shift_px
    y = np.arange(HEIGHT)[:, None] - (HEIGHT - 1) / 2 + vertical_px
    c, s = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    u, v = _MIDDLE + 2 * (c * x + s * y), _MIDDLE + 2 * (c * y - s * x)
    seen = cv2.remap(grey, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR)
    return _digitised(128 + gain * (seen - 128), rng, noise)


def clean(count: int, seed: int, reach_px: float) -> Iterator[Pair]:
    """Yield pairs that differ by a shift alone, a multiple of 1/64 px, which every OpenCV samples exactly."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        grey, shift_px = texture(rng), round(rng.uniform(-reach_px, reach_px) * 64) / 64
        yield Pair(view(grey, rng), view(grey, rng, shift_px), shift_px)


def hard(count: int, seed: int, reach_px: float) -> Iterator[Pair]:
    """Yield pairs with noise of deviation 8 in both eyes, gain 1.3, 1 degree of roll and 2 px vertically, together."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        grey, shift_px, sign = texture(rng), rng.uniform(-reach_px, reach_px), 1 - 2 * (k % 2)
        left = view(grey, rng, noise=8.0)
        yield Pair(left, view(grey, rng, shift_px, 2.0 * sign, sign, 1.3, 8.0), shift_px)


def thin(count: int, seed: int) -> Iterator[Pair]:
    """Yield upright rods 5 to 15 px wide before a textured background, banded or plain, with noise of deviation 2."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        background, d = texture(rng), float(rng.uniform(-100, 100))
        behind = d - float(rng.uniform(15, 120))
        half, slant = 0.5 * float(rng.uniform(5, 15)), float(rng.uniform(-0.1, 0.1))
        along = cv2.GaussianBlur(rng.standard_normal((HEIGHT, 1), np.float32), (0, 0), float(rng.uniform(0.6, 6.0)))
        rod = rng.uniform(30, 220) + rng.uniform(5, 50) * along / along.std()
        images = []
        for shift_px, ground_px in ((0.0, 0.0), (d, behind)):
            y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
            off = x - (WIDTH - 1) / 2 + shift_px - slant * (y - (HEIGHT - 1) / 2)
            inside = np.clip(half + 0.5 - np.abs(off), 0.0, 1.0)
            shaded = rod - 20.0 * np.square(off / half).clip(0.0, 1.0)
            ground = view(background, rng, ground_px).astype(np.float32)
            images.append(_digitised(inside * shaded + (1.0 - inside) * ground, rng, 2.0))
        yield Pair(images[0], images[1], d)


def deceptive(count: int, seed: int) -> Iterator[tuple[str, Pair]]:
    """Yield (kind, pair) in turn: blank walls, repeated textures, unrelated views, one eye covered."""
    rng = np.random.default_rng(seed)
    pool = [texture(rng) for _ in range(_POOL)]  # each is seen at another roll every time
    kinds = (_blank, _stripes, _board, _tiles, partial(_unrelated, pool=pool), partial(_covered, pool=pool))
    names = ("blank", "stripes", "board", "tiles", "unrelated", "covered")
    for k in range(count):
        yield names[k % len(kinds)], kinds[k % len(kinds)](rng)


def _digitised(grey: NDArray[np.floating], rng: np.random.Generator, noise: float) -> Image:
    noisy = grey + noise * rng.standard_normal(grey.shape, np.float32) if noise else grey
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _blank(rng: np.random.Generator) -> Pair:
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    shade = rng.uniform(60, 190) + rng.uniform(-0.1, 0.1) * (x - 320) + rng.uniform(-0.1, 0.1) * (y - 240)
    noise = float(rng.choice([0.0, 1.0, 3.0, 8.0]))
    return Pair(_digitised(shade, rng, noise), _digitised(shade, rng, noise), None)


def _periodic(rng: np.random.Generator, one: Grey) -> Pair:
    """See a wall of copies of one tile, an eighth of a pixel fine; its period is not a whole number of pixels."""
    period = np.array([rng.uniform(8, 70), rng.uniform(8, 70)])
    shift = np.array([rng.uniform(-100, 100), rng.uniform(-2, 2)])
    images, noise = [], float(rng.choice([1.0, 3.0, 8.0]))
    for offset in (np.zeros(2), shift):
        u = (((np.arange(WIDTH) + offset[0]) / period[0]) % 1.0) * one.shape[1]
        v = (((np.arange(HEIGHT) + offset[1]) / period[1]) % 1.0) * one.shape[0]
        grey = one[v.astype(int)[:, None], u.astype(int)[None, :]]
        images.append(_digitised(cv2.GaussianBlur(grey, (0, 0), 1.0), rng, noise))
    return Pair(images[0], images[1], float(shift[0]))


def _stripes(rng: np.random.Generator) -> Pair:
    one = np.full((512, 512), 70.0, np.float32)
    one[:, : int(rng.integers(150, 350))] = 185.0
    return _periodic(rng, one)


def _board(rng: np.random.Generator) -> Pair:
    one = np.full((512, 512), 70.0, np.float32)
    one[:256, :256] = one[256:, 256:] = 185.0
    return _periodic(rng, one)


def _tiles(rng: np.random.Generator) -> Pair:
    fine = np.tile(rng.standard_normal((128, 128), np.float32), (3, 3))
    fine = cv2.GaussianBlur(fine, (0, 0), 8.0)[128:256, 128:256]
    return _periodic(rng, cv2.resize(128 + 45 * fine / fine.std(), (512, 512)))


def _rolled(rng: np.random.Generator, grey: Grey, noise: float) -> Image:
    return view(grey, rng, roll_deg=rng.uniform(-180.0, 180.0), noise=noise)


def _unrelated(rng: np.random.Generator, pool: list[Grey]) -> Pair:
    first, second = rng.choice(len(pool), 2, replace=False)
    return Pair(_rolled(rng, pool[first], 2.0), _rolled(rng, pool[second], 2.0), None)


def _covered(rng: np.random.Generator, pool: list[Grey]) -> Pair:
    hand = cv2.resize(rng.uniform(10, 60, (6, 8)).astype(np.float32), (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    images = [_rolled(rng, pool[rng.integers(len(pool))], 3.0), _digitised(hand, rng, 3.0)]
    first = int(rng.integers(2))
    return Pair(images[first], images[1 - first], None)
