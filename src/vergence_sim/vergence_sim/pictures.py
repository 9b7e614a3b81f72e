"""Things with a picture on them: paintings, posters, book spines, a window's view, the faces of cubes.

Every function returns (h, w, 3) uint8 BGR, the same for the same generator.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from vergence_sim.parameters import DISTRACTORS
from vergence_sim.surfaces import Colour, Field, Image, cloud, grain, muted, print_text, shaded, wood

CUBE_COLOURS_BGR = (
    (243, 243, 240),
    (20, 205, 245),
    (40, 30, 195),
    (20, 115, 250),
    (165, 75, 15),
    (65, 155, 15),
)
"""White, yellow, red, orange, blue, green: a Rubik's cube's stickers."""


def profile(rng: np.random.Generator, length_px: int) -> Field:
    """Return (n,) float32 of a fractal curve, unit deviation: a ridge, a plotted signal."""
    return cloud(rng, (96, length_px), 5, 0.5)[48]


def painting(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a framed landscape or still life in visible brush strokes."""
    height, width = shape
    sky, land = np.array(muted(rng, 150, 230)), np.array(muted(rng, 60, 130))
    ramp = np.linspace(0, 1, height, dtype=np.float32)[:, None, None]
    canvas = np.asarray((1 - ramp) * sky + ramp * (0.6 * sky), np.float32) * np.ones((1, width, 1), np.float32)
    for layer in range(5):
        horizon = height * (0.35 + 0.14 * layer)
        ridge = horizon + profile(rng, width) * height * 0.06
        points = np.concatenate([np.stack([np.arange(width), ridge], 1), [[width, height], [0, height]]])
        colour = (land * (1.3 - 0.2 * layer) + rng.normal(0, 15, 3)).clip(0, 255).tolist()
        cv2.fillPoly(canvas, [points.astype(np.int32)], colour, cv2.LINE_AA)
    for _ in range(height * width // 260):
        x, y = int(rng.integers(0, width)), int(rng.integers(0, height))
        angle, length = rng.uniform(0, np.pi), rng.uniform(4, 14)
        end = (int(x + length * np.cos(angle)), int(y + length * np.sin(angle)))
        colour = (canvas[y, x] + rng.normal(0, 18)).clip(0, 255).tolist()
        cv2.line(canvas, (x, y), end, colour, int(rng.integers(1, 4)), cv2.LINE_AA)
    return _framed(rng, shaded(canvas, grain(rng, shape) * 4))


def poster(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a printed poster: a heading, a diagram, columns of text."""
    height, width = shape
    sheet = np.empty((height, width, 3), np.uint8)
    sheet[:] = rng.integers(185, 240, 3)
    ink = rng.uniform(20, 110, 3).tolist()
    heading = "".join(chr(int(c)) for c in rng.integers(65, 91, 6))
    cv2.putText(sheet, heading, (width // 14, height // 6), cv2.FONT_HERSHEY_DUPLEX, width / 170, ink, 3, cv2.LINE_AA)
    for _ in range(14):
        centre = (int(rng.uniform(0.1, 0.9) * width), int(rng.uniform(0.25, 0.6) * height))
        axes = (int(rng.uniform(0.02, 0.12) * width), int(rng.uniform(0.02, 0.09) * height))
        colour = rng.uniform(40, 230, 3).tolist()
        cv2.ellipse(sheet, centre, axes, float(rng.uniform(0, 180)), 0, 360, colour, int(rng.choice([-1, 2])))
        cv2.line(sheet, centre, (width // 2, int(0.42 * height)), ink, 1, cv2.LINE_AA)
    for column in (0, 1):
        left = int((0.06 + 0.47 * column) * width)
        box = (left, int(0.64 * height), left + int(0.42 * width), int(0.95 * height))
        print_text(rng, sheet, box, (50, 50, 55), 10)
    return shaded(sheet, cloud(rng, shape, 5) * 4 + grain(rng, shape) * 3)


def window_view(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a window in its frame: clouds, houses, trees."""
    height, width = shape
    scene = shaded((225, 190, 150), cloud(rng, shape, 7) * 22).astype(np.float32)
    left = 0
    while left < width:
        wide, high = int(rng.integers(width // 9, width // 4)), int(rng.uniform(0.25, 0.6) * height)
        base = np.array(muted(rng, 100, 190))
        cv2.rectangle(scene, (left, height - high), (left + wide, height), base.tolist(), -1)
        for x in range(left + 8, left + wide - 10, 20):
            for y in range(height - high + 8, height, 26):
                pane = (base * rng.uniform(0.3, 1.3)).clip(0, 255).tolist()
                cv2.rectangle(scene, (x, y), (x + 9, y + 14), pane, -1)
        left += wide
    for _ in range(420):
        place = (int(rng.integers(0, width)), int(height * (1 - 0.3 * rng.random() ** 1.5)))
        green = (40, float(rng.uniform(60, 150)), 50)
        cv2.circle(scene, place, int(rng.integers(3, 14)), green, -1, cv2.LINE_AA)
    bar = width // 26
    frame = wood(rng, shape, (205, 212, 215))
    mask = np.zeros(shape, bool)
    for x in (0, width // 2 - bar // 2, width - bar):
        mask[:, x : x + bar] = True
    for y in (0, height // 3, height - bar):
        mask[y : y + bar] = True
    scene[mask] = frame[mask]
    return shaded(scene, grain(rng, shape) * 3)


def book_spines(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a row of books: spines of their own width, height and colour, titled."""
    height, width = shape
    row = np.empty((height, width, 3), np.float32)
    row[:] = (22, 28, 34)
    left = 0
    while left < width - 6:
        wide = int(rng.integers(9, 30))
        top = int(rng.uniform(0.02, 0.28) * height)
        colour = np.array(muted(rng, 30, 180, 60))
        right = min(left + wide, width) - 1
        row[top:, left:right] = colour
        row[top:, left : left + 2] *= 0.6
        contrast = colour + (110 if colour.mean() < 115 else -100)
        for _ in range(int(rng.integers(1, 4))):
            band = int(rng.uniform(top, height))
            row[band : band + int(rng.integers(2, 7)), left:right] = np.clip(contrast, 0, 255)
        title = np.zeros((wide, height - top, 3), np.uint8)
        word = "".join(chr(int(c)) for c in rng.integers(65, 91, rng.integers(3, 10)))
        cv2.putText(title, word, (8, int(wide * 0.75)), cv2.FONT_HERSHEY_SIMPLEX, wide / 38, (1, 1, 1), 1, cv2.LINE_AA)
        letters = cv2.rotate(title, cv2.ROTATE_90_CLOCKWISE)[:, : right - left]
        row[top:, left:right] = row[top:, left:right] * (1 - letters) + np.clip(contrast, 0, 255) * letters
        left += wide
    return shaded(row, cloud(rng, shape, 5) * 4 + grain(rng, shape) * 4)


def book_cover(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a book's cover, a box's print: a few shapes, a title, small print."""
    height, width = shape
    cover = np.empty((height, width, 3), np.uint8)
    cover[:] = rng.integers(30, 215, 3)
    for _ in range(int(rng.integers(4, 9))):
        corners = rng.uniform(0, 1, (int(rng.integers(3, 6)), 2)) * (width, height)
        cv2.fillPoly(cover, [corners.astype(np.int32)], rng.uniform(20, 235, 3).tolist(), cv2.LINE_AA)
    title = "".join(chr(int(c)) for c in rng.integers(65, 91, 5))
    cv2.putText(
        cover, title, (width // 12, height // 3), cv2.FONT_HERSHEY_DUPLEX, width / 110, (235, 240, 240), 3, cv2.LINE_AA
    )
    print_text(rng, cover, (width // 12, int(height * 0.7), int(width * 0.9), int(height * 0.93)), (20, 20, 20), 11)
    return shaded(cover, cloud(rng, shape) * 8 + grain(rng, shape) * 4)


def screen(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a monitor showing a program's text and a graph."""
    height, width = shape
    picture = np.empty((height, width, 3), np.uint8)
    picture[:] = (48, 40, 36)
    print_text(rng, picture, (14, 14, width // 2, height - 14), (170, 215, 190), 11)
    for _ in range(4):
        curve = (0.5 + 0.16 * profile(rng, width // 2)) * height
        points = np.stack([np.arange(width // 2) + width // 2 - 10, curve], 1).astype(np.int32)
        cv2.polylines(picture, [points], False, rng.uniform(80, 255, 3).tolist(), 2, cv2.LINE_AA)
    cv2.rectangle(picture, (0, 0), (width - 1, height - 1), (18, 18, 18), 12)
    return shaded(picture, grain(rng, shape) * 2)


def cube_faces(rng: np.random.Generator, cells: int = 3, size_px: int = 192) -> list[Image]:
    """Return the six faces of a scrambled cube: rounded stickers with black gaps, a little worn.

    As on a real one every colour occurs equally often and, with an odd number of cells, has its own centre.
    """
    colour_numbers = np.repeat(np.arange(6), cells * cells - cells % 2)
    rng.shuffle(colour_numbers)
    faces = []
    for face in range(6):
        colours = colour_numbers[face * len(colour_numbers) // 6 : (face + 1) * len(colour_numbers) // 6].tolist()
        if cells % 2:
            colours.insert(cells * cells // 2, face)
        faces.append(stickers(rng, [CUBE_COLOURS_BGR[c] for c in colours], cells, size_px))
    return faces


def look_alike_faces(rng: np.random.Generator, size_px: int = 128, kind: str = "") -> list[Image]:
    """Return six faces of what is no Rubik's cube: puzzles of another size, dice, plain and striped bricks.

    `kind` is one of DISTRACTORS; empty lets `rng` choose.
    """
    kind = kind or str(rng.choice(DISTRACTORS))
    cells = {"two": 2, "four": 4, "five": 5}
    if kind in cells:
        return cube_faces(rng, cells[kind], size_px)
    base, ink = (CUBE_COLOURS_BGR[int(c)] for c in rng.permutation(6)[:2])
    faces = []
    for _ in range(6):
        face = np.empty((size_px, size_px, 3), np.float32)
        face[:] = base
        if kind == "die":
            for spot in rng.permutation(9)[: int(rng.integers(1, 7))].tolist():
                centre = ((spot % 3 * 2 + 1) * size_px // 6, (spot // 3 * 2 + 1) * size_px // 6)
                cv2.circle(face, centre, size_px // 14, ink, -1, cv2.LINE_AA)
        elif kind == "stripes":
            for row in range(0, size_px, size_px // 4):
                face[row : row + size_px // 8] = ink
        faces.append(shaded(face, cloud(rng, (size_px, size_px), 5) * 3 + grain(rng, (size_px, size_px)) * 3))
    return faces


def stickers(rng: np.random.Generator, colours: Sequence[Colour], cells: int, size_px: int) -> Image:
    """Return a face of a cube, `cells` by `cells` stickers of the given colours, row by row."""
    face = np.full((size_px, size_px, 3), 20, np.float32)
    cell = size_px / cells
    gap, radius = cell * 0.07, cell * 0.12
    for index, colour in enumerate(colours):
        left, top = (index % cells) * cell + gap, (index // cells) * cell + gap
        right, bottom = left + cell - 2 * gap, top + cell - 2 * gap
        for inset in ((radius, 0.0), (0.0, radius)):
            low = (round(left + inset[0]), round(top + inset[1]))
            high = (round(right - inset[0]) - 1, round(bottom - inset[1]) - 1)
            cv2.rectangle(face, low, high, colour, -1)
        for x in (left + radius, right - radius - 1):
            for y in (top + radius, bottom - radius - 1):
                cv2.circle(face, (round(x), round(y)), round(radius), colour, -1, cv2.LINE_AA)
    shape = (size_px, size_px)
    return shaded(face, cloud(rng, shape, 6, 0.8) * 4 + grain(rng, shape) * 2)


def _framed(rng: np.random.Generator, picture: Image) -> Image:
    height, width = picture.shape[:2]
    margin = max(6, width // 18)
    base: Colour = (40, 75, 110) if rng.random() < 0.5 else (35, 38, 40)
    frame = wood(rng, (height, width), base)
    frame[margin:-margin, margin:-margin] = picture[margin:-margin, margin:-margin]
    cv2.rectangle(frame, (margin, margin), (width - margin, height - margin), (20, 25, 28), 2)
    return frame
