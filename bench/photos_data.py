"""The pairs of photographs that the benchmark looks at, and the points on them whose disparity is known."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig, default_rig
from vergence_sim.photo.pair import PhotoPair, PhotoPoint, read_pair
from vergence_sim.photo.world import cropped

Image = npt.NDArray[np.uint8]

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "photographs"
VIEW_PX = 480, 320
LIT_DIFFERENTLY = "PianoL"
MOTORCYCLE = "stereo_motorcycle"
_ETH3D_FOCAL_PX = 542.0
_NEARER_PX = 1.5  # a disparity larger by this is another surface's
_FITTED_SHARE = 0.5  # of the motorcycle's columns, the left ones: bench/photos_disparity_fit.py may learn from those


class NoPhotographsError(ValueError):
    """The photographs are not on this machine."""


@dataclass(frozen=True)
class Target:
    """A point to click on, by the name of its pair."""

    pair: str
    point: PhotoPoint


def photographs_rig() -> Rig:
    """Return the shipped rig with its images cut to what a photograph fills at most poses."""
    return cropped(default_rig(), *VIEW_PX)


@lru_cache(maxsize=1)
def _described() -> Mapping[str, Mapping[str, object]]:
    try:
        described: Mapping[str, Mapping[str, object]] = json.loads((DATA / "targets.json").read_text(encoding="utf-8"))
    except OSError as error:
        raise NoPhotographsError(f"no photographs to look at: '{DATA}' cannot be read: {error.strerror}") from error
    return described


def pair_names() -> list[str]:
    """Return the names of all pairs; raises NoPhotographsError where there are none."""
    return sorted(_described())


def targets(name: str, count: int) -> list[Target]:
    """Return up to `count` targets of a pair, spread over the list of those that were prepared.

    "stereo_motorcycle" is scikit-image's pair: its targets are drawn, where there is texture.
    """
    if name == MOTORCYCLE:
        drawn = motorcycle_points(count, seed=22, least_texture=8.0)
        return [Target(name, PhotoPoint(p.x_px, p.y_px, p.disparity_px)) for p in drawn]
    listed = _described()[name]["targets"]
    assert isinstance(listed, list)
    count = min(count, len(listed))
    chosen = [listed[math.floor(i * len(listed) / count)] for i in range(count)]
    return [Target(name, PhotoPoint(t["x_px"], t["y_px"], t["disparity_px"])) for t in chosen]


def flattest(name: str, half_px: float) -> PhotoPoint:
    """Return the point of a pair whose surroundings differ least in disparity, `half_px` or more from any border.

    The points that were prepared, not those of scikit-image's pair.
    """
    described = _described()[name]
    listed, last_x, last_y = described["targets"], described["width_px"], described["height_px"]
    assert isinstance(listed, list)
    assert isinstance(last_x, int)
    assert isinstance(last_y, int)
    inside = [
        t
        for t in listed
        if half_px <= min(t["x_px"], t["x_px"] - t["disparity_px"], t["y_px"])
        and max(t["x_px"], t["x_px"] - t["disparity_px"]) <= last_x - 1 - half_px
        and t["y_px"] <= last_y - 1 - half_px
    ]
    best = min(inside, key=lambda t: float(t["spread_px"]))
    return PhotoPoint(best["x_px"], best["y_px"], best["disparity_px"])


@lru_cache(maxsize=2)
def pair_of(name: str) -> PhotoPair:
    """Return a pair with the camera that is natural for its source."""
    if name == MOTORCYCLE:
        left, right, _ = _motorcycle()
        return PhotoPair(np.ascontiguousarray(left[:, :, ::-1]), np.ascontiguousarray(right[:, :, ::-1]))
    focal_px = _ETH3D_FOCAL_PX if _described()[name]["source"] == "ETH3D" else 0.0
    return read_pair(DATA / f"{name}_left.jpg", DATA / f"{name}_right.jpg", focal_px)


@dataclass(frozen=True)
class KnownPoint:
    """A point (x, y) of a grey pair with its disparity [px]; `exact` tells measured truth from matched."""

    pair: str
    x_px: float
    y_px: float
    disparity_px: float
    exact: bool


def grey_pair(name: str) -> tuple[Image, Image]:
    """Return a pair in grey."""
    pair = pair_of(name)
    greys = [cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) for image in (pair.left, pair.right)]
    return np.asarray(greys[0], np.uint8), np.asarray(greys[1], np.uint8)


def motorcycle_points(count: int, seed: int, least_texture: float = 0.0, to_fit_on: bool = False) -> list[KnownPoint]:
    """Return points drawn evenly from where scikit-image's pair has its disparity, and both images show the place.

    The disparity was measured by structured light. The points lie in the right half of the left image, those to fit
    models on in its left half. `least_texture` is the least standard deviation of grey levels within 10 px.
    """
    _, _, disparity = _motorcycle()
    shown, grey = _shown_in_both(disparity), grey_pair(MOTORCYCLE)[0]
    height, width = disparity.shape
    rng = np.random.default_rng(seed)
    middle = round(_FITTED_SHARE * width)
    first, last = (20, middle) if to_fit_on else (middle, width - 20)
    points: list[KnownPoint] = []
    while len(points) < count:
        x, y = int(rng.integers(first, last)), int(rng.integers(20, height - 20))
        value, texture = float(disparity[y, x]), float(grey[y - 10 : y + 11, x - 10 : x + 11].std())
        if shown[y, x] and x - value > 20 and texture >= least_texture:
            points.append(KnownPoint(MOTORCYCLE, x, y, value, exact=True))
    return points


def _shown_in_both(disparity: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """Return where (h, w) the disparity is known and nothing nearer hides the place from the right eye."""
    rows, columns = np.nonzero(np.isfinite(disparity) & (np.arange(disparity.shape[1]) >= disparity))
    known = disparity[rows, columns]
    lands = columns - known
    nearest = np.full((disparity.shape[0], disparity.shape[1] + 1), -np.inf, np.float32)
    for column in (np.floor(lands), np.ceil(lands)):
        np.maximum.at(nearest, (rows, column.astype(int)), known)
    shown = np.zeros(disparity.shape, np.bool_)
    shown[rows, columns] = nearest[rows, np.rint(lands).astype(int)] - known <= _NEARER_PX
    return shown


@lru_cache(maxsize=1)
def _motorcycle() -> tuple[Image, Image, npt.NDArray[np.float32]]:
    from skimage.data import stereo_motorcycle

    left, right, disparity = stereo_motorcycle()
    return left, right, disparity
