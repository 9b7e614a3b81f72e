"""Stereo pairs with a known disparity at the image centre, for the contrast benchmark.

Every shift is real: both views are cut out of a picture that goes on beyond them, sub-pixel shifts by bicubic
interpolation, and nothing wraps around. Pictures are drawn (four kinds of texture) or photographs that scikit-image
ships; the two families of each that thresholds are fitted on are not those they are scored on.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

Grey = NDArray[np.uint8]
Picture = NDArray[np.float32]

VIEW_PX = 256
"""Side of the views of a judging pair: the largest judging window and its surroundings."""

FITTED_DRAWINGS, UNSEEN_DRAWINGS = ("polygons", "clouds"), ("blobs", "strokes")
FITTED_PHOTOGRAPHS = ("astronaut", "coffee", "coins", "rocket", "brick")
UNSEEN_PHOTOGRAPHS = ("camera", "chelsea", "hubble_deep_field", "immunohistochemistry", "gravel", "grass", "retina")

MINIMUM_GRADIENT = 6.0
"""RMS of the horizontal derivative in the central 50 px of every view used [grey levels per px]."""


@dataclass(frozen=True)
class Degradation:
    """Differences of two real cameras: noise in both views; gain, roll and vertical offset of the right one."""

    noise_sigma: float = 0.0
    gain: float = 1.0
    roll_rad: float = 0.0
    vertical_px: float = 0.0


HARD = Degradation(noise_sigma=8.0, gain=1.3, roll_rad=float(np.deg2rad(1.0)))


@dataclass(frozen=True)
class LabelledPair:
    """Two views, the disparity x_left - x_right of what lies at their centre [px], and where they come from."""

    left: Grey
    right: Grey
    disparity_px: float
    source: str


def polygons(rng: np.random.Generator, side: int) -> Picture:
    """Return overlapping flat polygons: long straight edges of all contrasts."""
    picture = np.full((side, side), 120.0, np.float32)
    for _ in range(side * side // 900):
        corners = rng.uniform(0, side, 2) + rng.uniform(-45, 45, (int(rng.integers(3, 7)), 2))
        hull = cv2.convexHull(corners.astype(np.float32)).astype(np.int32)
        cv2.fillConvexPoly(picture, hull, float(rng.uniform(10, 245)), cv2.LINE_AA)
    return cv2.GaussianBlur(picture, (0, 0), 0.8)


def clouds(rng: np.random.Generator, side: int) -> Picture:
    """Return noise whose amplitude falls as 1/frequency, the spectrum of natural images."""
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)[None])
    frequency[0, 0] = np.inf
    spectrum = np.exp(2j * np.pi * rng.random(frequency.shape)) / np.maximum(frequency, 4.0 / side)
    picture = np.fft.irfft2(spectrum, s=(side, side))
    return np.clip(125.0 + 60.0 * (picture - picture.mean()) / picture.std(), 0, 255).astype(np.float32)


def blobs(rng: np.random.Generator, side: int) -> Picture:
    """Return soft round spots: curved edges of every direction."""
    picture = np.full((side, side), 110.0, np.float32)
    for _ in range(side * side // 500):
        centre = rng.uniform(0, side, 2).astype(int)
        cv2.circle(picture, centre.tolist(), int(rng.integers(4, 22)), float(rng.uniform(10, 245)), -1, cv2.LINE_AA)
    return cv2.GaussianBlur(picture, (0, 0), 1.2)


def strokes(rng: np.random.Generator, side: int) -> Picture:
    """Return thin bright and dark lines, as of writing or branches."""
    picture = np.full((side, side), 130.0, np.float32)
    for _ in range(side * side // 700):
        start = rng.uniform(0, side, 2)
        path = (start + np.cumsum(rng.normal(0, 12, (int(rng.integers(2, 5)), 2)), axis=0)).astype(np.int32)
        thickness = int(rng.integers(1, 5))
        cv2.polylines(picture, [path], False, float(rng.choice([20, 60, 200, 240])), thickness, cv2.LINE_AA)
    return cv2.GaussianBlur(picture, (0, 0), 0.8)


DRAWINGS: dict[str, Callable[[np.random.Generator, int], Picture]] = {
    "polygons": polygons,
    "clouds": clouds,
    "blobs": blobs,
    "strokes": strokes,
}


@cache
def photograph(name: str) -> Picture:
    """Return one of scikit-image's own photographs as grey float32; those used here need no download."""
    from skimage import data

    image = getattr(data, name)()
    grey = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    return grey.astype(np.float32)


def cut(picture: Picture, centre_x: float, centre_y: float, height: int, width: int, roll_rad: float = 0.0) -> Picture:
    """Return the (height, width) view of `picture` whose principal point sees (`centre_x`, `centre_y`).

    A camera rolled by `roll_rad` (clockwise in its image positive for what it shows) sees the picture turned about its
    own centre. Raises ValueError where the view leaves the picture: no border is ever invented.
    """
    cos, sin = np.cos(roll_rad), np.sin(roll_rad)
    at_x, at_y = (width - 1) / 2, (height - 1) / 2
    inverse = np.array(
        [[cos, sin, centre_x - cos * at_x - sin * at_y], [-sin, cos, centre_y + sin * at_x - cos * at_y]]
    )
    corners = inverse @ np.array([[0, width - 1, 0, width - 1], [0, 0, height - 1, height - 1], [1, 1, 1, 1]])
    limit = np.array([picture.shape[1], picture.shape[0]])[:, None]
    if (corners < 1).any() or (corners > limit - 3).any():
        raise ValueError(f"a view of {width}x{height} about ({centre_x:.1f}, {centre_y:.1f}) leaves the picture")
    return cv2.warpAffine(picture, inverse, (width, height), flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP)


def exposed(view: Picture, rng: np.random.Generator, noise_sigma: float, gain: float = 1.0) -> Grey:
    """Return the camera image of `view`: gain, noise, saturation, 8 bits."""
    return np.clip(np.rint(gain * view + rng.normal(0.0, noise_sigma, view.shape)), 0, 255).astype(np.uint8)


def textured(view: Picture) -> bool:
    """Return whether the central 50 px of a view have the stated minimum gradient."""
    y, x = view.shape[0] // 2 - 25, view.shape[1] // 2 - 25
    return float(np.sqrt(np.mean(np.diff(view[y : y + 50, x : x + 51], axis=1) ** 2))) >= MINIMUM_GRADIENT


def labelled_pairs(
    rng: np.random.Generator,
    drawings: tuple[str, ...],
    photographs: tuple[str, ...],
    count: int,
    degradation: Degradation,
    disparity_px: Callable[[np.random.Generator], float],
) -> Iterator[LabelledPair]:
    """Yield `count` pairs whose fovea has a disparity drawn by `disparity_px`, half of them drawn, half photographed.

    Half of the drawn ones are a disc of 30 to 70 px radius before a background at another depth.
    """
    made = 0
    while made < count:
        disparity = disparity_px(rng)
        if made % 2 and photographs:
            name = photographs[int(rng.integers(len(photographs)))]
            picture, behind = photograph(name), None
        else:
            name = drawings[int(rng.integers(len(drawings)))]
            picture = DRAWINGS[name](rng, 480)
            behind = DRAWINGS[name](rng, 640) if rng.random() < 0.5 else None
        pair = _views(rng, picture, behind, disparity, degradation)
        if pair is not None:
            made += 1
            yield LabelledPair(pair[0], pair[1], disparity, name)


def _views(
    rng: np.random.Generator, picture: Picture, behind: Picture | None, disparity: float, degradation: Degradation
) -> tuple[Grey, Grey] | None:
    side = min(VIEW_PX, int(min(picture.shape) * 0.75))
    room_x = picture.shape[1] / 2 - side / 2 - abs(disparity) / 2 - 8
    room_y = picture.shape[0] / 2 - side / 2 - abs(degradation.vertical_px) - 8
    if room_x < 0 or room_y < 0:
        return None
    x = picture.shape[1] / 2 + rng.uniform(-room_x, room_x)
    y = picture.shape[0] / 2 + rng.uniform(-room_y, room_y)
    roll, vertical = degradation.roll_rad, degradation.vertical_px
    # a point at the left centre appears at x_right = x_left - disparity, y_right = y_left - vertical
    left = cut(picture, x - disparity / 2, y, side, side)
    right = cut(picture, x + disparity / 2, y + vertical, side, side, roll)
    if not textured(left):
        return None
    if behind is not None:
        depth = disparity - rng.uniform(8, 60)
        middle = behind.shape[1] / 2
        left_behind = cut(behind, middle - depth / 2, middle, side, side)
        right_behind = cut(behind, middle + depth / 2, middle + vertical, side, side, roll)
        radius = rng.uniform(30, 70)
        left = _before(left, left_behind, radius, 0.0, 0.0)
        right = _before(right, right_behind, radius, disparity, vertical)
    return (
        exposed(left, rng, degradation.noise_sigma),
        exposed(right, rng, degradation.noise_sigma, degradation.gain),
    )


def _before(front: Picture, behind: Picture, radius: float, disparity: float, vertical: float) -> Picture:
    """Return `behind` with a disc of `front` before it, where the disc's centre is seen at the left centre."""
    y, x = np.mgrid[: front.shape[0], : front.shape[1]].astype(np.float32)
    middle = (front.shape[0] - 1) / 2
    weight = np.clip(radius + 0.5 - np.hypot(x - middle + disparity, y - middle + vertical), 0, 1)
    return weight * front + (1 - weight) * behind
