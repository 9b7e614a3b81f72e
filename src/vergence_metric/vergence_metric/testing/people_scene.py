"""Persons before both eyes without a simulator: boxes with noise, and images in which the nearer hides the farther.

Each is a board of 0.18 by 0.24 m with a random texture of its own, which moves along a path.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.association import Association, associate
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.pair_geometry import PairGeometry
from vergence_metric.boxes.parameters import AssociationParameters
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig

SIZE_PX = (640, 480)
_HALF_M = (0.09, 0.12)
_HIDDEN_SHARE = 0.5  # of a box, beyond which a detector misses it

Path = Callable[[float], tuple[float, float, float]]
Sides = tuple[float, float, float, float]


def sway(x_m: float, y_m: float, amplitude_m: float, period_s: float, phase: float = 0.0) -> Path:
    """A path to the sides and a third as much towards the head and back."""

    def at(time_s: float) -> tuple[float, float, float]:
        turn = math.sin(2 * math.pi * time_s / period_s + phase)
        return x_m + amplitude_m / 3 * math.cos(2 * math.pi * time_s / period_s + phase), y_m + amplitude_m * turn, 0.0

    return at


def walk(x_m: float, from_y_m: float, speed_m_s: float) -> Path:
    """A path straight to one side."""
    return lambda time_s: (x_m, from_y_m + speed_m_s * time_s, 0.0)


class PeopleScene:
    """Persons on their paths, seen by eyes that may turn; `class_id` 0, named "face"."""

    def __init__(self, paths: Sequence[Path], seed: int = 0, noise_px: float = 1.5, miss_share: float = 0.05) -> None:
        self.paths, self._noise_px, self._miss_share = list(paths), noise_px, miss_share
        self._random = np.random.default_rng(seed)
        coarse = [self._random.uniform(30, 225, (6, 5, 3)).astype(np.uint8) for _ in paths]
        self._textures = [cv2.resize(c, (90, 120), interpolation=cv2.INTER_CUBIC) for c in coarse]
        rig = default_rig()
        self._cameras = CameraModel(rig.left_camera), CameraModel(rig.right_camera)
        self._kinematics = Kinematics(rig)

    def geometry(self, eyes: EyeAngles | None = None) -> PairGeometry:
        """The geometry of a pair that eyes at these angles take."""
        return PairGeometry(*self._cameras, eyes or EyeAngles(0.0, 0.0, 0.0), self._kinematics)

    def look(
        self, time_s: float, eyes: EyeAngles | None = None
    ) -> tuple[Association, tuple[NDArray[np.uint8], NDArray[np.uint8]], PairGeometry, dict[int, int]]:
        """Return the boxes as paired, both images, the geometry, and of each box's id() whose it is."""
        geometry = self.geometry(eyes)
        points = [np.array(path(time_s)) for path in self.paths]
        images: list[NDArray[np.uint8]] = []
        seen: list[list[tuple[Box, int]]] = []
        for left in (True, False):
            image = np.full((SIZE_PX[1], SIZE_PX[0], 3), 90, np.uint8)
            owner = np.full(image.shape[:2], -1)
            true = {}
            for person in sorted(range(len(points)), key=lambda i: -points[i][0]):
                true[person] = self._box(geometry, left, points[person])
                x0, y0, x1, y1 = (round(v) for v in true[person])
                if x1 <= 0 or y1 <= 0 or x0 >= SIZE_PX[0] or y0 >= SIZE_PX[1]:
                    continue
                picture = cv2.resize(self._textures[person], (x1 - x0, y1 - y0))
                inside = slice(max(y0, 0), min(y1, SIZE_PX[1])), slice(max(x0, 0), min(x1, SIZE_PX[0]))
                rows, columns = inside
                image[inside] = picture[rows.start - y0 : rows.stop - y0, columns.start - x0 : columns.stop - x0]
                owner[inside] = person
            images.append(image)
            seen.append(self._detected(true, owner))
        pair = images[0], images[1]
        left_boxes, right_boxes = ([box for box, _ in of_eye] for of_eye in seen)
        found = associate(left_boxes, right_boxes, AssociationParameters(), 0.0, pair, geometry)
        return found, pair, geometry, {id(box): person for of_eye in seen for box, person in of_eye}

    def _box(self, geometry: PairGeometry, left: bool, point: NDArray[Any]) -> Sides:
        """Return the true box of a board at a point that faces the eye."""
        pan = geometry.eyes.pan_left_rad if left else geometry.eyes.pan_right_rad
        ray = point - self._kinematics.lens(left, pan, geometry.eyes.tilt_rad)
        x, y = geometry.pixel(left, ray)
        half = [geometry.left.fx_px * h / float(np.linalg.norm(ray)) for h in _HALF_M]
        return x - half[0], y - half[1], x + half[0], y + half[1]

    def _detected(self, true: Mapping[int, Sides], owner: NDArray[Any]) -> list[tuple[Box, int]]:
        boxes = []
        for person, sides in sorted(true.items()):
            noisy = np.array(sides) + self._random.normal(0.0, self._noise_px, 4)
            missed = self._random.random() < self._miss_share
            whole = (sides[2] - sides[0]) * (sides[3] - sides[1])
            if missed or (owner == person).sum() < (1.0 - _HIDDEN_SHARE) * whole:
                continue
            clipped = np.clip(noisy, -0.5, np.tile(SIZE_PX, 2) - 0.5)
            x_min, y_min, x_max, y_max = clipped.tolist()
            left, top, right, bottom = (clipped != noisy).tolist()
            boxes.append((Box((x_min, y_min, x_max, y_max), 0.9, 0, "face", (left, top, right, bottom)), person))
        return boxes
