"""What both eyes see of photographs at 640x480: verged on a target and not, at rest, with the noise of a sensor."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from bench.photos_data import pair_names, pair_of, targets
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.rig import Rig, default_rig
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.pair import PhotoPair, PhotoPoint
from vergence_sim.photo.world import PhotoWorld

Image = npt.NDArray[np.uint8]

_FILLED_PX = 540  # height to which a photograph is enlarged, so that it fills the views
_EVERY = 24  # targets of a photograph among which the one nearest to its centre is chosen


@dataclass(frozen=True)
class Glance:
    """Successive pairs (h, w, 3) BGR of eyes at rest; `verged`: both foveas are on one point of the photograph."""

    name: str
    verged: bool
    eyes: EyeAngles
    pairs: list[tuple[Image, Image]]


def glances(count: int, pairs: int, rig: Rig | None = None) -> list[Glance]:
    """Return `count` photographs as verged eyes see them, then with parallel eyes, `pairs` pairs of images each.

    Raises NoPhotographsError where there are none.
    """
    names = pair_names()
    chosen = [names[(i * len(names)) // count] for i in range(count)]
    return [_glance(name, verged, pairs, rig or default_rig()) for name in chosen for verged in (True, False)]


def models(rig: Rig | None = None) -> tuple[CameraModel, CameraModel]:
    """Return both cameras of the rig."""
    rig = rig or default_rig()
    return CameraModel(rig.left_camera), CameraModel(rig.right_camera)


def _glance(name: str, verged: bool, count: int, rig: Rig) -> Glance:
    pair, point = _enlarged(pair_of(name), _central(name))
    eyes = pair.fixation(point)
    if not verged:
        eyes = EyeAngles(eyes.pan_left_rad, eyes.pan_left_rad, eyes.tilt_rad)
    world = PhotoWorld(pair, SimParameters.of({"seed": 16, "head.model": "rolled"}), rig)
    world.head.place(eyes.as_dict())
    return Glance(name, verged, eyes, [(world.view("left"), world.view("right")) for _ in range(count)])


def _central(name: str) -> PhotoPoint:
    pair = pair_of(name)
    points = [target.point for target in targets(name, _EVERY)]
    return min(points, key=lambda p: (p.x_px - pair.cx_px) ** 2 + (p.y_px - pair.cy_px) ** 2)


def _enlarged(pair: PhotoPair, point: PhotoPoint) -> tuple[PhotoPair, PhotoPoint]:
    scale = _FILLED_PX / pair.height_px
    left, right = (
        np.asarray(cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR), np.uint8)
        for image in (pair.left, pair.right)
    )
    enlarged = PhotoPair(left, right, scale * pair.fx_px)
    return enlarged, PhotoPoint(scale * point.x_px, scale * point.y_px, scale * point.disparity_px)
