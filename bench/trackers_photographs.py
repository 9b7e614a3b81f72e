"""The handed photographs as sequences under known homographies: a click, a saccade to it, then a sweep about it.

Or the eyes stand still, and only the sensors' noise changes from image to image.
"""

import math
from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.photos_data import NoPhotographsError, pair_names, pair_of, photographs_rig, targets
from bench.trackers_scenes import FRAME_S, REQUEST_FRAME, Frame
from vergence_rig.geometry import EyeAngles
from vergence_rig.rig import Rig
from vergence_sim.optics import Lens
from vergence_sim.photo.views import PhotoEye

__all__ = ["NoPhotographsError", "photograph_rig", "sensed", "sequences", "spread", "standing"]

Image = NDArray[np.uint8]

_PAIRS_USED, _STANDING = 12, 10
_SACCADE, _REST, _SWEEP = 4, 12, 40  # pairs
_ASIDE_RAD, _ABOVE_RAD = math.radians(7.0), math.radians(3.0)
_SWEEP_RAD = math.radians(4.0)
_LANDING_RAD = math.radians(0.4)  # by which the joints are not where they report, after the saccade
_NOISE = 2.5
_HALF_PX = 15.0  # of the square about the point that counts as it


def photograph_rig() -> Rig:
    """Return the rig of the sequences."""
    return photographs_rig()


def sequences(count: int = _PAIRS_USED) -> Iterator[tuple[str, list[Frame]]]:
    """Yield name and frames for one point of each of `count` pairs. Raises NoPhotographsError without photographs."""
    for number, name in spread(count):
        yield name, list(_frames(name, number, range(REQUEST_FRAME + 1 + _SACCADE + _REST + _SWEEP)))


def standing(count: int = _PAIRS_USED) -> Iterator[tuple[str, list[Frame]]]:
    """Yield name and frames as `sequences`, of eyes that stand still."""
    for number, name in spread(count):
        yield name, list(_frames(name, number, [REQUEST_FRAME + _SACCADE] * _STANDING))


def sensed(view: Image, rng: np.random.Generator) -> tuple[Image, Image]:
    """Return what a sensor makes of a view (h, w, 3) BGR: grey (h, w) and colour, with the same noise."""
    grey = cv2.cvtColor(view, cv2.COLOR_BGR2GRAY).astype(np.float32)
    noise = _NOISE * rng.standard_normal(grey.shape, np.float32)
    noisy = (np.clip(np.rint(one), 0, 255).astype(np.uint8) for one in (grey + noise, view + noise[:, :, None]))
    return next(noisy), next(noisy)


def spread(count: int) -> Iterator[tuple[int, str]]:
    """Yield numbers and names of `count` of the pairs, spread over all."""
    names = pair_names()
    for number in range(count):
        yield number, names[number * len(names) // count]


def _frames(name: str, seed: int, poses: Iterable[int]) -> Iterator[Frame]:
    """Yield the frames of the poses of a saccade and a sweep that are numbered."""
    rig, rng = photographs_rig(), np.random.default_rng(seed)
    pair, point = pair_of(name), targets(name, 3)[1].point
    focal_px = Lens(rig.left_camera).render_focal_px
    *photographs, matrix = pair.seen_at(focal_px)
    eyes = [
        PhotoEye(photograph, matrix, Lens(camera), np.eye(3))
        for photograph, camera in zip(photographs, (rig.left_camera, rig.right_camera), strict=True)
    ]
    rays = pair.rays(point)
    on = pair.fixation(point)
    side = 1.0 if point.x_px > 0.5 * pair.width_px else -1.0  # the eyes come from the middle of the picture
    for k, number in enumerate(poses):
        landed = min(max(number - REQUEST_FRAME, 0) / _SACCADE, 1.0)
        swept = max(number - REQUEST_FRAME - _SACCADE - _REST, 0) / _SWEEP
        aside = (1.0 - landed) * side * _ASIDE_RAD - side * _SWEEP_RAD * math.sin(2 * math.pi * swept)
        true = EyeAngles(
            on.pan_left_rad + aside, on.pan_right_rad + aside, on.tilt_rad + (1.0 - landed) * _ABOVE_RAD * side
        )
        off = landed * _LANDING_RAD
        reported = EyeAngles(true.pan_left_rad + off, true.pan_right_rad + off, true.tilt_rad - off)
        images, colours, places = [], [], []
        for eye, pan_rad, ray in zip(eyes, (true.pan_left_rad, true.pan_right_rad), rays, strict=True):
            grey, colour = sensed(eye.view(pan_rad, true.tilt_rad), rng)
            images.append(grey)
            colours.append(colour)
            places.append(eye.project(ray, pan_rad, true.tilt_rad))
        x, y = places[0]
        square = np.array([(x + i * _HALF_PX, y + j * _HALF_PX) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        yield Frame(
            k * FRAME_S,
            images[0],
            images[1],
            (colours[0], colours[1]),
            reported,
            places[0],
            places[1],
            np.zeros(3),
            square,
            not 0.0 < landed < 1.0,
            False,
            true,
        )
