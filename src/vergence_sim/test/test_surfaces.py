"""Surfaces and pictures: structure at every place, none repeated, the same for the same seed."""

from collections import Counter

import cv2
import numpy as np
import pytest

from vergence_sim import pictures, surfaces

SHAPE = (160, 224)
LEAST_GRADIENT = 1.5  # grey levels per pixel
BASE = (150.0, 160.0, 170.0)
MAKERS = {
    "plaster": lambda rng: surfaces.plaster(rng, SHAPE, BASE),
    "bricks": lambda rng: surfaces.bricks(rng, SHAPE, BASE),
    "wallpaper": lambda rng: surfaces.wallpaper(rng, SHAPE, BASE),
    "wood": lambda rng: surfaces.wood(rng, SHAPE, planks=3),
    "cloth": lambda rng: surfaces.cloth(rng, SHAPE, BASE),
    "carpet": lambda rng: surfaces.carpet(rng, SHAPE),
    "card": lambda rng: surfaces.card(rng, SHAPE),
    "leaf": lambda rng: surfaces.leaf(rng, SHAPE),
    "painting": lambda rng: pictures.painting(rng, SHAPE),
    "poster": lambda rng: pictures.poster(rng, SHAPE),
    "window_view": lambda rng: pictures.window_view(rng, SHAPE),
    "book_spines": lambda rng: pictures.book_spines(rng, SHAPE),
    "book_cover": lambda rng: pictures.book_cover(rng, SHAPE),
    "screen": lambda rng: pictures.screen(rng, SHAPE),
}


def mean_gradient(image):
    """Return the mean magnitude of an image's grey gradient (Sobel 3x3 over 8) [grey levels a pixel]."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    x, y = cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=0.125)
    return float(np.hypot(x, y).mean())


@pytest.fixture(params=MAKERS, ids=str)
def make(request):
    return MAKERS[request.param]


def test_the_same_seed_gives_the_same_surface_and_another_does_not(make):
    first, again, other = (make(np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert first.shape == (*SHAPE, 3)
    assert first.dtype == np.uint8
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_surface_has_the_structure_it_states(make):
    assert mean_gradient(make(np.random.default_rng(1))) >= LEAST_GRADIENT


@pytest.mark.parametrize("name", ["plaster", "bricks", "wallpaper", "cloth"])
def test_a_wall_does_not_repeat(name):
    """No shift of a quarter of its width and more looks like the wall itself: mean correlation stays low."""
    grey = cv2.cvtColor(MAKERS[name](np.random.default_rng(2)), cv2.COLOR_BGR2GRAY).astype(np.float32)
    grey -= cv2.GaussianBlur(grey, (0, 0), 12)
    spectrum = np.fft.rfft2(grey)
    likeness = np.fft.irfft2(np.abs(spectrum) ** 2, grey.shape)
    likeness /= likeness[0, 0]
    far = likeness[:, SHAPE[1] // 4 : -SHAPE[1] // 4]
    assert np.abs(far).max() < 0.6


def test_the_gradient_of_a_ramp_is_its_slope():
    ramp = np.repeat((np.arange(100, dtype=np.uint8) * 2)[None, :, None], 50, 0).repeat(3, 2)
    assert mean_gradient(ramp) == pytest.approx(2 * 98 / 100, rel=1e-6)


def test_a_scrambled_cube_has_nine_stickers_of_each_colour_and_six_centres():
    found: Counter[int] = Counter()
    centres = []
    for face in pictures.cube_faces(np.random.default_rng(3), 3, 192):
        numbers = []
        for row in (32, 96, 160):
            for column in (32, 96, 160):
                colour = face[row - 8 : row + 8, column - 8 : column + 8].reshape(-1, 3).mean(0)
                numbers.append(int(np.argmin([np.abs(colour - c).sum() for c in pictures.CUBE_COLOURS_BGR])))
        found.update(numbers)
        centres.append(numbers[4])
    assert set(found.values()) == {9}
    assert sorted(centres) == list(range(6))


def test_look_alikes_are_six_square_faces_of_every_kind():
    shapes = {
        tuple(face.shape) for seed in range(12) for face in pictures.look_alike_faces(np.random.default_rng(seed), 96)
    }
    assert shapes == {(96, 96, 3)}
