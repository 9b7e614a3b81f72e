"""The visual encoder on pairs of images: from pixels to the eyes' relative rotation, or why there is none."""

import math
import time
from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
import numpy.typing as npt

from vergence_metric.eye_rotation.epipolar_view import epipolar_view
from vergence_metric.eye_rotation.matching import MatchingSettings, matches
from vergence_metric.eye_rotation.parameters import EncoderParameters
from vergence_metric.eye_rotation.relative_rotation import (
    MINIMUM_MATCHES,
    RelativeRotation,
    RigDoubt,
    relative_rotation,
)
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.rig import Rig

Pixels = npt.NDArray[np.uint8]
Models = tuple[CameraModel, CameraModel]

_PLAY_TO_SIGMA = 1.0 / math.sqrt(3.0)
_VERGENCE_PRIOR = 2.0


class EyeRotationStatus(IntEnum):
    """Whether the eyes' rotation was measured; the values of EyeRotation.msg."""

    OK = 0
    MOVING = 1
    FEW_FEATURES = 2
    DISAGREEING = 3
    UNCERTAIN = 4
    CONTRADICTORY = 5
    NO_JOINTS = 6
    NO_CAMERA_INFO = 7


@dataclass(frozen=True)
class EyeRotationReading:
    """What one pair says: the rotation where the status is OK or tells why it is not believed, else None.

    `joint_vergence_rad` is what the joints say, NaN if unknown.
    """

    status: EyeRotationStatus
    reason: str
    joint_vergence_rad: float
    rotation: RelativeRotation | None = None
    corners: int = 0
    matches: int = 0
    residual_px: float = math.nan
    took_s: float = 0.0

    @property
    def ok(self) -> bool:
        """True if the rotation is to be believed."""
        return self.status is EyeRotationStatus.OK


class VisualEncoder:
    """Measures pairs by their own; nothing is carried from one to the next."""

    def __init__(self, parameters: EncoderParameters, rig: Rig) -> None:
        self.parameters = self._p = parameters
        self._baseline_m = rig.baseline_m
        servos = (rig.joints.pan_left.servo, rig.joints.pan_right.servo)
        self._play_rad = sum(servo.uncertainty_rad for servo in servos)
        self._pan_doubt_rad = _PLAY_TO_SIGMA * max(servo.uncertainty_rad for servo in servos)

    @property
    def believed_rad(self) -> float:
        """How far from the joints a vergence may be and still be believed."""
        return self._play_rad + self._p.mount_tolerance_rad

    def measure(self, left: Pixels, right: Pixels, eyes: EyeAngles, models: Models) -> EyeRotationReading:
        """Return what a pair says.

        Args:
            left: (h, w, 3) BGR or (h, w) grey image of the left eye.
            right: the same of the right eye, of one size with it.
            eyes: joint angles at the images' stamps.
            models: the left and the right camera, for images of this size.

        """
        began_s = time.perf_counter()
        step_rad = 1.0 / models[0].fx_px
        views = [
            epipolar_view(_grey(image), camera, pan, step_rad)
            for image, camera, pan in zip((left, right), models, (eyes.pan_left_rad, eyes.pan_right_rad), strict=True)
        ]
        found = matches(views[0], views[1], self._matching())
        rotation = None
        if len(found.left_px) >= MINIMUM_MATCHES:
            plane = [
                view.to_image_plane(points) for view, points in zip(views, (found.left_px, found.right_px), strict=True)
            ]
            rotation = relative_rotation(
                plane[0], plane[1], eyes.pan_left_rad, eyes.pan_right_rad, self._doubt(step_rad)
            )
        status, reason = self._verdict(rotation, len(found.left_px), found.corners, step_rad, eyes)
        return EyeRotationReading(
            status,
            reason,
            eyes.vergence_rad,
            rotation,
            found.corners,
            len(found.left_px),
            rotation.scale_rad / step_rad if rotation else math.nan,
            time.perf_counter() - began_s,
        )

    def _matching(self) -> MatchingSettings:
        return MatchingSettings(
            features=self._p.features,
            nearest_parallax_rad=2.0 * math.atan(0.5 * self._baseline_m / self._p.nearest_m),
            aside_rad=self.believed_rad,
            rows_px=round(self._p.row_search_px),
            score=self._p.match_score,
            other_score=self._p.rival_score,
        )

    def _doubt(self, step_rad: float) -> RigDoubt:
        return RigDoubt(
            vergence_rad=_VERGENCE_PRIOR * self.believed_rad,
            pan_rad=math.hypot(self._pan_doubt_rad, 0.5 * self._p.mount_tolerance_rad),
            focal=self._p.focal_doubt,
            distortion=self._p.distortion_doubt,
            centre_rad=self._p.centre_doubt_px * step_rad,
        )

    def _verdict(
        self, rotation: RelativeRotation | None, found: int, corners: int, step_rad: float, eyes: EyeAngles
    ) -> tuple[EyeRotationStatus, str]:
        p = self._p
        if rotation is None or found < p.least_inliers:
            return (
                EyeRotationStatus.FEW_FEATURES,
                f"{found} of {corners} features found in both eyes: it takes {max(p.least_inliers, MINIMUM_MATCHES)}",
            )
        residual_px = rotation.scale_rad / step_rad
        if (
            rotation.inliers < p.least_inliers
            or rotation.inlier_share < p.least_inlier_share
            or residual_px > p.most_residual_px
        ):
            return (
                EyeRotationStatus.DISAGREEING,
                f"{rotation.inliers} of {found} matches agree, to {residual_px:.2f} px: no one rotation explains them",
            )
        if not rotation.sigma_rad <= p.most_sigma_rad:
            return (
                EyeRotationStatus.UNCERTAIN,
                f"vergence is certain to {math.degrees(rotation.sigma_rad):.2f} degrees only: "
                "the features do not spread over the image",
            )
        beyond_rad = abs(rotation.vergence_rad - eyes.vergence_rad)
        if beyond_rad > self.believed_rad:
            return (
                EyeRotationStatus.CONTRADICTORY,
                f"vergence is {math.degrees(beyond_rad):.2f} degrees off the joints': "
                f"servos and mounts allow {math.degrees(self.believed_rad):.2f}",
            )
        return EyeRotationStatus.OK, ""


def not_measured(status: EyeRotationStatus, reason: str, eyes: EyeAngles | None = None) -> EyeRotationReading:
    """Return that a pair was not even looked at, and why."""
    return EyeRotationReading(status, reason, math.nan if eyes is None else eyes.vergence_rad)


def _grey(image: npt.NDArray[np.uint8]) -> Pixels:
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
