"""Faces as pictures on panels before both eyes, drawn by homographies: where every landmark is seen is known.

A panel stands anywhere, turned about its upright and its level axis, and hides what is behind it. Its picture is scaled
so that the eyes in it are as far apart as a person's.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.detections import Box, Pixel
from vergence_metric.boxes.pair_geometry import PairGeometry
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig, default_rig

EYE_DISTANCE_M = 0.063
"""Between the pupils of an adult in the mean."""

_HIDDEN_SHARE = 0.4  # of a face's landmarks, beyond which a detector misses it

Image = NDArray[np.uint8]
Array = NDArray[np.float64]


@dataclass(frozen=True)
class FacePicture:
    """A picture (h, w, 3) BGR with the box (4,) and the five landmarks (5, 2) of the face in it [px]."""

    image: Image
    xyxy_px: tuple[float, float, float, float]
    landmarks_px: Array

    def points_m(self, eye_distance_m: float = EYE_DISTANCE_M) -> tuple[Array, Array, Array]:
        """Return the picture's corners (4, 2), its box's (4, 2) and its landmarks (5, 2) in metres about the eyes."""
        right_eye, left_eye = self.landmarks_px[:2]
        scale = eye_distance_m / float(np.hypot(*(left_eye - right_eye)))
        height, width = self.image.shape[:2]
        x_min, y_min, x_max, y_max = self.xyxy_px
        corners = np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])
        box = np.array([[x_min, y_min], [x_max, y_min], [x_max, y_max], [x_min, y_max]])
        middle = 0.5 * (right_eye + left_eye)
        return (corners - middle) * scale, (box - middle) * scale, (self.landmarks_px - middle) * scale


@dataclass(frozen=True)
class FacePanel:
    """A picture at a place: between the eyes at `point_m` (3,) in rig_base, turned from facing the head [rad].

    `gain` is its brightness, `eye_distance_m` the picture's scale.
    """

    picture: FacePicture
    point_m: tuple[float, float, float]
    yaw_rad: float = 0.0
    roll_rad: float = 0.0
    gain: float = 1.0
    eye_distance_m: float = EYE_DISTANCE_M

    def at(self, points_m: Array) -> Array:
        """Return points (N, 2) of the picture's plane, x right and y down as seen, in rig_base (N, 3)."""
        azimuth = math.atan2(self.point_m[1], self.point_m[0]) + self.yaw_rad
        right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
        down = np.array([0.0, 0.0, -1.0])
        c, s = math.cos(self.roll_rad), math.sin(self.roll_rad)
        turned = points_m @ np.array([[c, s], [-s, c]])
        return np.asarray(self.point_m + turned[:, :1] * right + turned[:, 1:] * down)


class PanelView:
    """Both eyes' views of panels before a wall."""

    def __init__(self, seed: int = 0, noise: float = 2.0, rig: Rig | None = None) -> None:
        """Make a wall by a seed; `noise` is the standard deviation of the images' grey levels."""
        self.rig = rig or default_rig()
        self.cameras = CameraModel(self.rig.left_camera), CameraModel(self.rig.right_camera)
        self.kinematics = Kinematics(self.rig)
        self._random, self._noise = np.random.default_rng(seed), noise
        coarse = self._random.uniform(60, 200, (40, 60, 3)).astype(np.uint8)
        self._wall = cv2.GaussianBlur(cv2.resize(coarse, (1800, 1200), interpolation=cv2.INTER_CUBIC), (0, 0), 2.0)

    def geometry(self, eyes: EyeAngles) -> PairGeometry:
        """Return the geometry of a pair that eyes at these angles take."""
        return PairGeometry(self.cameras[0], self.cameras[1], eyes, self.kinematics)

    def pixels(self, left: bool, eyes: EyeAngles, points_m: Array) -> Array:
        """Return where an eye sees points (N, 3) of rig_base, (N, 2); NaN behind it."""
        pan = eyes.pan_left_rad if left else eyes.pan_right_rad
        turn = self.kinematics.rotation_rig_from_optical(pan, eyes.tilt_rad)
        rays = (points_m - self.kinematics.lens(left, pan, eyes.tilt_rad)) @ turn
        return np.asarray(self.cameras[0 if left else 1].ray_to_pixel(rays))

    def images(
        self, panels: Sequence[FacePanel], eyes: EyeAngles, gains: tuple[float, float] = (1.0, 1.0)
    ) -> tuple[tuple[Image, Image], tuple[NDArray[Any], NDArray[Any]]]:
        """Return both images (h, w, 3), and whose each pixel is (h, w): a panel's number, or -1."""
        pictures, owners = [], []
        for left, gain in zip((True, False), gains, strict=True):
            camera = self.cameras[0 if left else 1]
            size = (camera.width_px, camera.height_px)
            wall = np.array([[3.6, 2.7, 1.8], [3.6, -2.7, 1.8], [3.6, -2.7, -1.8], [3.6, 2.7, -1.8]])
            picture = _placed(self._wall, self.pixels(left, eyes, wall), size)[0].astype(np.float32)
            owner = np.full(picture.shape[:2], -1)
            for number in sorted(range(len(panels)), key=lambda i: -float(np.linalg.norm(panels[i].point_m))):
                panel = panels[number]
                corners = panel.at(panel.picture.points_m(panel.eye_distance_m)[0])
                drawn, inside = _placed(panel.picture.image, self.pixels(left, eyes, corners), size)
                picture[inside] = panel.gain * drawn[inside]
                owner[inside] = number
            noisy = gain * picture + self._random.normal(0.0, self._noise, picture.shape)
            pictures.append(np.clip(noisy, 0, 255).astype(np.uint8))
            owners.append(owner)
        return (pictures[0], pictures[1]), (owners[0], owners[1])

    def detections(
        self,
        panels: Sequence[FacePanel],
        eyes: EyeAngles,
        owners: tuple[NDArray[Any], NDArray[Any]],
        noise_share: float = 0.02,
        miss_share: float = 0.0,
    ) -> tuple[Mapping[int, Box], Mapping[int, Box]]:
        """Return each eye's boxes by their panels' numbers, of the faces that are not hidden.

        Args:
            panels: in view.
            eyes: joint angles.
            owners: whose each pixel is; see `images`.
            noise_share: of the distance between the eyes, and half a pixel: error of a landmark.
            miss_share: of the faces that are not detected.

        """
        found: list[dict[int, Box]] = [{}, {}]
        for i, owner in enumerate(owners):
            height, width = owner.shape
            for number, panel in enumerate(panels):
                _, box_m, points_m = panel.picture.points_m(panel.eye_distance_m)
                points = self.pixels(i == 0, eyes, panel.at(points_m))
                corners = self.pixels(i == 0, eyes, panel.at(box_m))
                whole = np.isfinite(points).all() and np.isfinite(corners).all()
                if not whole or self._random.random() < miss_share:
                    continue
                columns, rows = np.rint(points).astype(int).T
                inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
                seen = inside & (owner[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)] == number)
                if seen.mean() < 1.0 - _HIDDEN_SHARE or not inside[:2].all():
                    continue
                sigma = math.hypot(0.5, noise_share * float(np.hypot(*(points[1] - points[0]))))
                points = points + self._random.normal(0.0, sigma, points.shape)
                sides = np.concatenate([corners.min(0), corners.max(0)]) + self._random.normal(0.0, 2.0 * sigma, 4)
                found[i][number] = _box(sides, points, (width, height), float(self._random.uniform(0.75, 0.95)))
        return found[0], found[1]


def _box(sides: Array, points: Array, size_px: tuple[int, int], score: float) -> Box:
    clipped = np.clip(sides, -0.5, np.tile(size_px, 2) - 0.5)
    x_min, y_min, x_max, y_max = clipped.tolist()
    left, top, right, bottom = (clipped != sides).tolist()
    landmarks: tuple[Pixel, ...] = tuple((float(x), float(y)) for x, y in points)
    return Box((x_min, y_min, x_max, y_max), score, 0, "face", (left, top, right, bottom), landmarks)


def _placed(image: Image, corners_px: Array, size_px: tuple[int, int]) -> tuple[Image, NDArray[np.bool_]]:
    """Return an image with its corners at pixels (4, 2), and where it is (h, w)."""
    shape = (size_px[1], size_px[0])
    if not np.isfinite(corners_px).all():
        return np.zeros((*shape, 3), np.uint8), np.zeros(shape, bool)
    height, width = image.shape[:2]
    source = np.array(
        [[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]], np.float32
    )
    shrink = width / max(float(np.hypot(*(corners_px[1] - corners_px[0]))), 1.0)
    smooth = cv2.GaussianBlur(image, (0, 0), 0.45 * shrink) if shrink > 1.3 else image
    matrix = cv2.getPerspectiveTransform(source, corners_px.astype(np.float32))
    drawn = cv2.warpPerspective(smooth, matrix, size_px, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    covered = cv2.warpPerspective(np.full(image.shape[:2], 255, np.uint8), matrix, size_px, flags=cv2.INTER_NEAREST)
    return np.asarray(drawn, np.uint8), np.asarray(covered > 0)
