"""The visual encoder on a pair of images: from pixels to the eyes' relative rotation, or the reason for none."""

import math
import time
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from vergence_metric.edges.edges import to_grey
from vergence_metric.eye_rotation.epipolar_view import epipolar_view
from vergence_metric.eye_rotation.matching import MatchingSettings, matches
from vergence_metric.eye_rotation.parameters import EncoderParameters
from vergence_metric.eye_rotation.relative_rotation import (
    MIN_MATCHES,
    RelativeRotation,
    RigPrior,
    relative_rotation,
)
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics, rotation_pan_from_camera
from vergence_rig.rig import Rig

Pixels = npt.NDArray[np.uint8]
Models = tuple[CameraModel, CameraModel]

_UNIFORM_TO_SIGMA = 1.0 / math.sqrt(3.0)
_VERGENCE_SIGMAS = 2.0  # standard deviation of the vergence prior, as a multiple of the largest deviation


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
    """Result of one pair. `rotation` is valid if `status` is OK, rejected for `reason` otherwise, None if not computed.

    `joint_vergence_rad` is the vergence by the joint angles, NaN if unknown.
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
        """True if the rotation is valid."""
        return self.status is EyeRotationStatus.OK


class VisualEncoder:
    """Measures single pairs, without state between them."""

    def __init__(self, parameters: EncoderParameters, rig: Rig) -> None:
        self._p = parameters
        self._kinematics = Kinematics(rig)
        self._mounts = (rotation_pan_from_camera(rig.left_mount), rotation_pan_from_camera(rig.right_mount))
        servos = (rig.joints.pan_left.servo, rig.joints.pan_right.servo)
        self._servo_uncertainty_rad = sum(servo.uncertainty_rad for servo in servos) + rig.zero_error_rad
        self._zero_sigma_rad = rig.zero_sigma_rad
        self._pan_sigma_rad = _UNIFORM_TO_SIGMA * max(servo.uncertainty_rad for servo in servos)

    @property
    def max_deviation_rad(self) -> float:
        """Largest deviation from the joints' vergence that servos and mounts allow."""
        return self._servo_uncertainty_rad + self._p.acceptance.mount_tolerance_rad

    def measure(self, left: Pixels, right: Pixels, eyes: EyeAngles, models: Models) -> EyeRotationReading:
        """Measure a pair.

        Args:
            left: (h, w, 3) BGR or (h, w) grey image of the left eye.
            right: the same of the right eye.
            eyes: eye angles at the images' stamps.
            models: the left and the right camera, each for images of its size.

        """
        began_s = time.perf_counter()
        step_rad, size_px = 1.0 / models[0].fx_px, (models[0].width_px, models[0].height_px)
        # Where lenses lie before their axes, the line through both turns with the eyes.
        lens = self._kinematics.lens
        across = lens(True, eyes.pan_left_rad, 0.0) - lens(False, eyes.pan_right_rad, 0.0)
        turned_rad = math.atan2(float(across[0]), float(across[1]))
        pans = (eyes.pan_left_rad + turned_rad, eyes.pan_right_rad + turned_rad)
        views = [
            epipolar_view(to_grey(image), camera, pan, step_rad, mount, size_px)
            for image, camera, pan, mount in zip((left, right), models, pans, self._mounts, strict=True)
        ]
        found = matches(views[0], views[1], self._matching())
        rotation = None
        if len(found.left_px) >= MIN_MATCHES:
            plane = [
                view.to_image_plane(points) for view, points in zip(views, (found.left_px, found.right_px), strict=True)
            ]
            rotation = relative_rotation(plane[0], plane[1], *pans, self._prior(step_rad))
        status, reason = self._accepted(rotation, len(found.left_px), found.corners, step_rad, eyes)
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
            features=self._p.matching.features,
            nearest_parallax_rad=2.0 * math.atan(0.5 * self._kinematics.baseline_m / self._p.matching.nearest_m),
            aside_rad=self.max_deviation_rad,
            rows_px=round(self._p.matching.row_search_px),
            score=self._p.matching.min_score,
            uniqueness=self._p.matching.uniqueness,
        )

    def _prior(self, step_rad: float) -> RigPrior:
        return RigPrior(
            vergence_rad=_VERGENCE_SIGMAS * self.max_deviation_rad,
            pan_rad=math.hypot(self._pan_sigma_rad, 0.5 * self._p.acceptance.mount_tolerance_rad, self._zero_sigma_rad),
            focal=self._p.prior.focal_sigma,
            distortion=self._p.prior.distortion_sigma,
            centre_rad=self._p.prior.centre_sigma_px * step_rad,
        )

    def _accepted(
        self, rotation: RelativeRotation | None, found: int, corners: int, step_rad: float, eyes: EyeAngles
    ) -> tuple[EyeRotationStatus, str]:
        p = self._p.acceptance
        if rotation is None or found < p.min_inliers:
            return (
                EyeRotationStatus.FEW_FEATURES,
                f"{found} of {corners} features matched: at least {max(p.min_inliers, MIN_MATCHES)} are needed",
            )
        residual_px = rotation.scale_rad / step_rad
        if (
            rotation.inliers < p.min_inliers
            or rotation.inlier_share < p.min_inlier_share
            or residual_px > p.max_residual_px
        ):
            return (
                EyeRotationStatus.DISAGREEING,
                f"only {rotation.inliers} of {found} matches agree on one rotation, to {residual_px:.2f} px",
            )
        if not rotation.sigma_rad <= p.max_sigma_rad:
            return (
                EyeRotationStatus.UNCERTAIN,
                f"standard deviation of the vergence is {math.degrees(rotation.sigma_rad):.2f} degrees: "
                "the features are not spread over the image",
            )
        deviation_rad = abs(rotation.vergence_rad - eyes.vergence_rad)
        if deviation_rad > self.max_deviation_rad:
            return (
                EyeRotationStatus.CONTRADICTORY,
                f"vergence differs from the joints' by {math.degrees(deviation_rad):.2f} degrees: "
                f"servos and mounts allow {math.degrees(self.max_deviation_rad):.2f}",
            )
        return EyeRotationStatus.OK, ""


def not_measured(status: EyeRotationStatus, reason: str, eyes: EyeAngles | None = None) -> EyeRotationReading:
    """Return the reading of a pair that was not measured, with the reason."""
    return EyeRotationReading(status, reason, math.nan if eyes is None else eyes.vergence_rad)
