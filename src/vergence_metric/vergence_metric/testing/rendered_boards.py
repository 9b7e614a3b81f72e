"""Rendered sequences for tests of trackers: textured boards before a wall, seen by eyes that turn."""

import math
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity import make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.tracking.eye_view import eye_views
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.registry import make_tracker
from vergence_metric.tracking.request import StoredPair
from vergence_metric.tracking.track import Track, TrackStatus
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, rotation_rig_from_optical
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
from vergence_rig.testing.ideal_eyes import eye_position, gaze_for_point

Grey = NDArray[np.float32]
Image = NDArray[np.uint8]
Point = Sequence[float] | NDArray[np.float64]

RIG = default_rig()
CAMERA = CameraModel(RIG.left_camera)
FRAME_S = 1 / 30
_K = np.array([[539.0, 0, 319.5], [0, 539.0, 239.5], [0, 0, 1.0]])


def texture(seed: int, shape: tuple[int, int], sigmas: Iterable[float]) -> Grey:
    """Return a random texture (h, w) with blobs of these sizes [px]."""
    rng = np.random.default_rng(seed)
    layers = [cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), s) * s for s in sigmas]
    out = np.sum(layers, axis=0)
    return np.asarray(np.clip(128 + 45 * (out - out.mean()) / out.std(), 0, 255), np.float32)


WALL = texture(1, (900, 1400), (2.0, 5.0, 12.0))
TARGET, OTHER = texture(2, (96, 96), (3.0, 6.0)), texture(3, (96, 96), (3.0, 6.0))


def draw_board(
    image: Grey,
    surface: Grey,
    center_m: Point,
    size_m: tuple[float, float],
    left: bool,
    eyes: EyeAngles,
    slant_rad: float = 0.0,
) -> None:
    """Draw a board that faces the head, its right side turned away by `slant_rad`; `size_m` is (width, height)."""
    pan = eyes.pan_left_rad if left else eyes.pan_right_rad
    per_px = np.array(size_m) / (surface.shape[1], surface.shape[0])
    right = per_px[0] * np.array([math.sin(slant_rad), -math.cos(slant_rad), 0.0])
    down = np.array([0.0, 0.0, -per_px[1]])
    corner = np.array(center_m) - right * (surface.shape[1] - 1) / 2 - down * (surface.shape[0] - 1) / 2
    columns = np.column_stack([right, down, corner - eye_position(left, RIG.baseline_m)])
    homography = _K @ rotation_rig_from_optical(pan, eyes.tilt_rad).T @ columns
    cv2.warpPerspective(surface, homography, (640, 480), dst=image, borderMode=cv2.BORDER_TRANSPARENT)


def true_pixel(point_m: Point, left: bool, eyes: EyeAngles) -> NDArray[np.float64]:
    """Return the pixel (2,) at which an eye sees a point (3,) of rig_base [m]."""
    pan = eyes.pan_left_rad if left else eyes.pan_right_rad
    ray = rotation_rig_from_optical(pan, eyes.tilt_rad).T @ (np.array(point_m) - eye_position(left, RIG.baseline_m))
    return np.asarray(CAMERA.ray_to_pixel(ray[None])[0])


def gaze(point_m: Point) -> EyeAngles:
    """Return the angles that fixate a point (3,) of rig_base [m]."""
    return gaze_for_point(np.array(point_m), RIG.baseline_m)


class Stage:
    """Shows frame after frame to a tracker and keeps what it says beside the truth.

    `errors` are rows of the errors of left x, left y and disparity [px].
    """

    def __init__(self, kind: str = "remembered_patch", **parameters: float) -> None:
        self.kind = kind
        self.tracker = make_tracker(
            TrackerParameters(kind=kind, **parameters),  # type: ignore[arg-type]
            make_estimator(DisparityParameters()),
            CAMERA,
            Kinematics(RIG),
        )
        self.frame = 0
        self.pair: StoredPair | None = None
        self.tracks: list[Track] = []
        self.errors: list[tuple[float, float, float]] = []

    def show(
        self,
        target_m: Point,
        eyes: EyeAngles,
        occluder_m: Point | None = None,
        covered: Sequence[str] = (),
        slant_rad: float = 0.0,
        joints: EyeAngles | None = None,
    ) -> Track:
        """Show a frame; `joints` are the reported angles, if they differ from the true ones."""
        images = []
        for left in (True, False):
            image = np.full((480, 640), 90, np.float32)
            draw_board(image, WALL, (3.0, 0.0, 0.0), (7.0, 4.5), left, eyes)
            draw_board(image, TARGET, target_m, (0.06, 0.06), left, eyes, slant_rad)
            if occluder_m is not None:
                draw_board(image, OTHER, occluder_m, (0.08, 0.08), left, eyes)
            if ("left" if left else "right") in covered:
                image[:] = 15
            image += 2.0 * cv2.randn(np.empty((480, 640), np.float32), 0, 1)
            images.append(np.asarray(np.clip(image, 0, 255), np.uint8))
        reported = joints or eyes
        views = eye_views(CAMERA, reported, Kinematics(RIG))
        self.pair = StoredPair(self.frame * FRAME_S, images[0], images[1], views)
        track = self.tracker.update(images[0], images[1], self.frame * FRAME_S, reported)
        true_left, true_right = true_pixel(target_m, True, eyes), true_pixel(target_m, False, eyes)
        self.tracks.append(track)
        off = np.array(track.left_px) - true_left
        self.errors.append((float(off[0]), float(off[1]), track.disparity_px - float(true_left[0] - true_right[0])))
        self.frame += 1
        return track

    def lock(self, target_m: Point, eyes: EyeAngles) -> Track:
        """Show a target until it is locked on; returns the first track of it."""
        for _ in range(12):
            if self.show(target_m, eyes).status is TrackStatus.OK:
                return self.tracks[-1]
        raise AssertionError(f"no lock: {self.tracks[-1].status.name}, {self.tracks[-1].reason}")
