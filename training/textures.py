"""Clutter for training: collages of shapes and letters."""

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]


def cloud(rng: np.random.Generator, size_px: int, octaves: int = 6, roughness: float = 0.62) -> npt.NDArray[np.float32]:
    """Return (n, n) float32 fractal noise of zero mean and unit deviation."""
    field = np.zeros((size_px, size_px), np.float32)
    for octave in range(octaves):
        cells = 4 * 2**octave
        noise = rng.standard_normal((cells, cells), dtype=np.float32)
        field += roughness**octave * cv2.resize(noise, (size_px, size_px), interpolation=cv2.INTER_CUBIC)
    return (field - field.mean()) / field.std()


def painted(rng: np.random.Generator, size_px: int, base_bgr: tuple[int, ...], contrast: float) -> Image:
    """Return (n, n, 3) of a painted, stained surface: fractal noise in brightness and, weaker, in colour."""
    shade = cloud(rng, size_px)[:, :, None] * contrast
    tint = np.stack([cloud(rng, size_px, 4) for _ in range(3)], axis=2) * 0.35 * contrast
    return np.clip(np.array(base_bgr, np.float32) + shade + tint, 0, 255).astype(np.uint8)


def collage(rng: np.random.Generator, size_px: int, pieces: int = 90, plain: float = 0.2) -> Image:
    """Return (n, n, 3) of overlapping coloured shapes, letters and blots: a picture, a poster, a book's cover."""
    image = painted(rng, size_px, tuple(int(v) for v in rng.integers(90, 220, 3)), 14)
    for _ in range(pieces):
        colour = tuple(int(v) for v in rng.integers(10, 250, 3))
        centre = tuple(int(v) for v in rng.integers(0, size_px, 2))
        extent = int(size_px * rng.uniform(0.01, 0.13))
        kind = rng.integers(0, 4)
        if kind == 0:
            cv2.circle(image, centre, extent, colour, -1 if rng.random() > plain else 2, cv2.LINE_AA)
        elif kind == 1:
            box = cv2.boxPoints(
                (centre, (extent * 2.0, extent * float(rng.uniform(0.4, 2.0))), float(rng.uniform(0, 180)))
            )
            cv2.fillPoly(image, [box.astype(np.int32)], colour, cv2.LINE_AA)
        elif kind == 2:
            word = "".join(chr(int(c)) for c in rng.integers(65, 91, rng.integers(2, 7)))
            cv2.putText(
                image, word, centre, int(rng.integers(0, 4)), float(rng.uniform(0.5, 1.8)), colour, 2, cv2.LINE_AA
            )
        else:
            end = tuple(int(v) for v in np.array(centre) + rng.integers(-extent * 3, extent * 3 + 1, 2))
            cv2.line(image, centre, end, colour, int(rng.integers(1, 5)), cv2.LINE_AA)
    return np.clip(image + cloud(rng, size_px, 8, 0.85)[:, :, None] * 7, 0, 255).astype(np.uint8)
