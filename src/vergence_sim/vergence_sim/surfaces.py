"""Procedural surfaces: paint, brick, planks, cloth, card. Rich at every scale, never repeating, seeded.

Every function returns (h, w, 3) uint8 BGR with enough texture for a stereo matcher.
"""

import itertools

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
Field = npt.NDArray[np.float32]
Colour = tuple[float, float, float]


def cloud(rng: np.random.Generator, shape: tuple[int, int], octaves: int = 7, roughness: float = 0.6) -> Field:
    """Return (h, w) float32 fractal noise of zero mean and unit deviation; rougher is finer."""
    height, width = shape
    field = np.zeros(shape, np.float32)
    for octave in range(octaves):
        cells = 3 * 2**octave
        rows, columns = max(2, round(cells * height / max(shape))), max(2, round(cells * width / max(shape)))
        if rows >= height or columns >= width:
            rows, columns = height, width
        noise = rng.standard_normal((rows, columns), dtype=np.float32)
        field += roughness**octave * cv2.resize(noise, (width, height), interpolation=cv2.INTER_LINEAR)
    field -= field.mean()
    field /= field.std()
    return field


def grain(rng: np.random.Generator, shape: tuple[int, int]) -> Field:
    """Return (h, w) float32 of fine grain, one to four pixels wide, unit deviation."""
    fine = cv2.GaussianBlur(rng.standard_normal(shape, dtype=np.float32), (0, 0), 0.8)
    coarse = cv2.GaussianBlur(rng.standard_normal(shape, dtype=np.float32), (0, 0), 2.0)
    field = np.asarray(fine / fine.std() + coarse / coarse.std(), np.float32)
    return np.asarray(field / field.std(), np.float32)


def muted(rng: np.random.Generator, darkest: float, lightest: float, spread: float = 28) -> Colour:
    """Return a colour of a grey level between two, `spread` levels away from grey."""
    blue, green, red = (rng.uniform(darkest, lightest) + rng.normal(0, spread, 3)).clip(8, 250)
    return float(blue), float(green), float(red)


def shaded(base: Colour | npt.NDArray, shade: Field) -> Image:
    """Return a colour or an image (h, w, 3) with `shade` grey levels added."""
    return np.clip(np.asarray(base, np.float32) + shade[:, :, None], 0, 255).astype(np.uint8)


def plaster(rng: np.random.Generator, shape: tuple[int, int], base: Colour) -> Image:
    """Return a painted wall: a rolled coat's grain over faint stains."""
    tint = np.stack([cloud(rng, shape, 4) for _ in range(3)], axis=2) * 2.5
    return shaded(np.asarray(base, np.float32) + tint, cloud(rng, shape) * 5 + grain(rng, shape) * 5)


def bricks(rng: np.random.Generator, shape: tuple[int, int], base: Colour, course_px: int = 34) -> Image:
    """Return a brick wall: every brick of its own length, colour and wear, in pale mortar."""
    height, width = shape
    wall = np.empty((height, width, 3), np.float32)
    wall[:] = (150, 160, 165)
    top = 0
    while top < height:
        left = -int(rng.integers(0, 2 * course_px))
        depth = int(rng.integers(course_px - 3, course_px + 4))
        while left < width:
            length = int(rng.integers(round(1.9 * course_px), round(3.0 * course_px)))
            colour = np.asarray(base, np.float32) * float(rng.uniform(0.7, 1.25)) + rng.normal(0, 7, 3)
            cv2.rectangle(wall, (left + 3, top + 3), (left + length - 3, top + depth - 3), colour.tolist(), -1)
            left += length
        top += depth
    wall = cv2.GaussianBlur(wall, (0, 0), 0.8)
    return shaded(wall, cloud(rng, shape, 8, 0.75) * 9 + grain(rng, shape) * 6)


def wallpaper(rng: np.random.Generator, shape: tuple[int, int], base: Colour) -> Image:
    """Return papered wall: sprigs scattered at random, none like another, on faint stripes."""
    height, width = shape
    paper = np.empty((height, width, 3), np.float32)
    paper[:] = base
    edges = np.cumsum(rng.integers(18, 60, width // 15))
    for left, right in zip(edges[:-1:2], edges[1::2], strict=False):
        paper[:, left:right] *= float(rng.uniform(0.93, 0.98))
    for _ in range(height * width // 2600):
        centre = np.array([rng.integers(0, width), rng.integers(0, height)])
        colour = (np.asarray(base) * rng.uniform(0.45, 0.85, 3)).tolist()
        turn = rng.uniform(0, 360)
        for petal in range(int(rng.integers(3, 7))):
            angle = np.deg2rad(turn + petal * rng.uniform(50, 75))
            reach = rng.uniform(3, 9)
            place = tuple(int(v) for v in centre + reach * np.array([np.cos(angle), np.sin(angle)]))
            axes = (int(rng.integers(2, 6)), int(rng.integers(1, 4)))
            cv2.ellipse(paper, place, axes, float(np.rad2deg(angle)), 0, 360, colour, -1, cv2.LINE_AA)
    return shaded(paper, cloud(rng, shape) * 4 + grain(rng, shape) * 3)


def wood(rng: np.random.Generator, shape: tuple[int, int], base: Colour = (70, 112, 160), planks: int = 1) -> Image:
    """Return wood with its grain along x: bent rings, knots' shadows, pores; in planks of their own shade."""
    height, width = shape
    board = np.empty((height, width, 3), np.float32)
    edges = np.linspace(0, height, planks + 1).round().astype(int)
    for low, high in itertools.pairwise(edges.tolist()):
        size = (high - low, width)
        across = np.linspace(0, 1, size[0], dtype=np.float32)[:, None]
        rings = np.sin(40 * across * float(rng.uniform(0.5, 1.2)) + cloud(rng, size, 3) * 2.2)
        pores = cv2.blur(rng.standard_normal(size, dtype=np.float32), (41, 1))
        shade = rings * 7 + pores / pores.std() * 8 + cloud(rng, size, 6, 0.75) * 5
        board[low:high] = np.asarray(base, np.float32) * float(rng.uniform(0.82, 1.15)) + shade[:, :, None]
        if planks > 1:
            board[low : low + 2] *= 0.45
            seam = int(rng.integers(0, width - 2))
            board[low:high, seam : seam + 2] *= 0.5
    return np.clip(board, 0, 255).astype(np.uint8)


def cloth(rng: np.random.Generator, shape: tuple[int, int], base: Colour) -> Image:
    """Return woven cloth: threads both ways, uneven, with folds' light and shade."""
    weft = cv2.blur(rng.standard_normal(shape, dtype=np.float32), (23, 1))
    warp = cv2.blur(rng.standard_normal(shape, dtype=np.float32), (1, 23))
    threads = weft / weft.std() + warp / warp.std()
    return shaded(base, np.asarray(threads * 7 + cloud(rng, shape, 4) * 10, np.float32))


def carpet(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a rug: bordered, strewn with motifs of its own few colours, woven."""
    height, width = shape
    colours = [tuple(float(v) for v in rng.integers(25, 190, 3)) for _ in range(5)]
    rug = np.empty((height, width, 3), np.float32)
    rug[:] = colours[0]
    for _ in range(height * width // 500):
        centre = (int(rng.integers(0, width)), int(rng.integers(0, height)))
        radius = int(rng.integers(3, 15))
        cv2.ellipse(
            rug,
            centre,
            (radius, max(2, radius // 2)),
            float(rng.choice([0, 45, 90, 135])),
            0,
            360,
            colours[int(rng.integers(1, 5))],
            int(rng.choice([-1, 2])),
        )
    for margin, colour in ((4, colours[1]), (18, colours[3]), (30, colours[2])):
        cv2.rectangle(rug, (margin, margin), (width - margin, height - margin), colour, 4)
    return shaded(rug, cloud(rng, shape, 5) * 6 + grain(rng, shape) * 9)


def card(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a face of a cardboard box: flutes, a strip of tape, scuffs, often a printed label."""
    height, width = shape
    base = np.array((95, 140, 180), np.float32) * float(rng.uniform(0.75, 1.1))
    flutes = np.sin(np.arange(height, dtype=np.float32) * 1.3)[:, None] * 2
    face = shaded(base, cloud(rng, shape) * 7 + grain(rng, shape) * 4 + flutes).astype(np.float32)
    tape = int(rng.uniform(0.35, 0.65) * width)
    face[:, tape - width // 16 : tape + width // 16] *= (0.85, 0.95, 1.05)
    face = np.clip(face, 0, 255).astype(np.uint8)
    if rng.random() < 0.7:
        left, top = int(rng.uniform(0.05, 0.4) * width), int(rng.uniform(0.1, 0.45) * height)
        right, bottom = left + int(0.5 * width), top + int(0.4 * height)
        cv2.rectangle(face, (left, top), (right, bottom), (225, 230, 232), -1)
        print_text(rng, face, (left + 6, top + 6, right - 6, bottom - 6), (40, 40, 45))
    for _ in range(12):
        start = rng.integers(0, (width, height))
        end = start + rng.integers(-30, 31, 2)
        shade = float(rng.uniform(60, 200))
        cv2.line(face, tuple(start.tolist()), tuple(end.tolist()), (shade * 0.7, shade * 0.85, shade), 1, cv2.LINE_AA)
    return np.asarray(face, np.uint8)


def print_text(
    rng: np.random.Generator, image: npt.NDArray, box: tuple[int, int, int, int], colour: Colour, height_px: int = 14
) -> None:
    """Print lines of made-up words into `box` (x0, y0, x1, y1) of a uint8 image, in place."""
    left, top, right, bottom = box
    y = top + height_px
    while y < bottom:
        x = left
        while x < right - 2 * height_px:
            word = "".join(chr(int(c)) for c in rng.integers(97, 123, rng.integers(2, 9)))
            scale = height_px / 30
            (length, _), _ = cv2.getTextSize(word, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
            if x + length > right:
                break
            cv2.putText(image, word, (x, y), cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
            x += length + height_px // 2
        y += int(height_px * 1.5)


def leaf(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a leaf's surface: veins from a rib, blotches."""
    height, width = shape
    blade = shaded((45, 120 * float(rng.uniform(0.7, 1.2)), 60), cloud(rng, shape) * 14 + grain(rng, shape) * 5)
    cv2.line(blade, (0, height // 2), (width, height // 2), (110, 190, 150), 3, cv2.LINE_AA)
    for x in range(0, width, 17):
        for side in (0, height):
            cv2.line(blade, (x, height // 2), (x + 30, side), (85, 165, 120), 1, cv2.LINE_AA)
    return blade
