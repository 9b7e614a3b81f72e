"""From views to intrinsics and to the pose of one eye against the other (Zhang 2000, by OpenCV's bundle adjustment)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from vergence_camera.calibration.boards import Detection
from vergence_camera.calibration.views import View
from vergence_camera.camera_info import Calibration

Matrix = npt.NDArray[np.float64]

LEAST_VIEWS = 3
_LEAST_BASELINE_M = 1e-3
# With fewer views the sixth power of the radius bends to the noise instead of the lens.
_VIEWS_FOR_K3 = 12
_OUTLIER_FACTOR = 3.0
_OUTLIER_FLOOR_PX = 0.5


class SolveError(ValueError):
    """Views from which no calibration can be computed; the message says what is missing."""


@dataclass(frozen=True)
class Intrinsics:
    """One camera: matrix (3, 3), distortion (5,) k1 k2 p1 p2 k3, their standard deviations, and the errors.

    `rms_px` is over all corners, `view_rms_px` by name of view; `rejected` holds the views left out, with reasons.
    """

    size_px: tuple[int, int]
    matrix: Matrix
    distortion: Matrix
    focal_sigma_px: tuple[float, float]
    centre_sigma_px: tuple[float, float]
    rms_px: float
    view_rms_px: dict[str, float]
    rejected: dict[str, str]

    def calibration(self, name: str) -> Calibration:
        """Return it in camera_info's form. Rectification is left out: the eyes turn."""
        return Calibration(
            self.size_px[0],
            self.size_px[1],
            tuple(float(x) for x in self.matrix.ravel()),
            tuple(float(x) for x in self.distortion),
            name=name,
        )


@dataclass(frozen=True)
class StereoPose:
    """Where the right camera is: x_right = rotation @ x_left + translation_m, in optical frames."""

    rotation: Matrix
    translation_m: Matrix
    rms_px: float
    view_rms_px: dict[str, float]
    rejected: dict[str, str]

    @property
    def baseline_m(self) -> float:
        """Distance of the two cameras [m]."""
        return float(np.linalg.norm(self.translation_m))


def solve_camera(views: Sequence[View], eye: str, size_px: tuple[int, int]) -> Intrinsics:
    """Return the intrinsics of one eye; views that fit far worse than the rest are left out and named.

    Args:
        views: with corners for `eye`.
        eye: "left" or "right".
        size_px: width and height of the pictures.

    Raises:
        SolveError: fewer than three views, or none that fits.
    """
    kept, rejected = list(views), dict[str, str]()
    while True:
        if len(kept) < LEAST_VIEWS:
            raise SolveError(f"{eye}: {len(kept)} usable views, at least {LEAST_VIEWS} are needed")
        result = _solve_once(kept, eye, size_px)
        worst, limit = _outlier(result.view_rms_px)
        if worst is None:
            return Intrinsics(**{**vars(result), "rejected": rejected})
        rejected[worst] = (
            f"{eye}: {result.view_rms_px[worst]:.2f} px off, at most {limit:.2f} px fit in with the others"
        )
        kept = [view for view in kept if view.name != worst]


def solve_pair(views: Sequence[View], left: Intrinsics, right: Intrinsics) -> StereoPose:
    """Return the pose of the right eye against the left, with the intrinsics held.

    Raises:
        SolveError: fewer than three views, or none that fits.
    """
    kept, rejected = list(views), dict[str, str]()
    while True:
        if len(kept) < LEAST_VIEWS:
            raise SolveError(f"pair: {len(kept)} usable views, at least {LEAST_VIEWS} are needed")
        rms, _, _, _, _, rotation, translation, *_ = cv2.stereoCalibrate(
            [view.corners["left"].points_m for view in kept],
            [view.corners["left"].points_px for view in kept],
            [view.corners["right"].points_px for view in kept],
            left.matrix,
            left.distortion,
            right.matrix,
            right.distortion,
            left.size_px,
            flags=cv2.CALIB_FIX_INTRINSIC,
            criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-9),
        )
        rotation, translation = np.asarray(rotation), np.asarray(translation).ravel()
        errors = {view.name: _pair_error_px(view, left, right, rotation, translation) for view in kept}
        worst, limit = _outlier(errors)
        if worst is None:
            return StereoPose(rotation, translation, float(rms), errors, rejected)
        rejected[worst] = (
            f"pair: {errors[worst]:.2f} px off, at most {limit:.2f} px fit in with the others: did the board move "
            "between the two pictures?"
        )
        kept = [view for view in kept if view.name != worst]


def check_sides(pose: StereoPose) -> None:
    """Raise SolveError where the eye called right is left of the other."""
    # The pose takes points of the left eye to the right one: what is seen from further right lies further left.
    across_m = float(pose.translation_m[0])
    if across_m > _LEAST_BASELINE_M and across_m >= 0.5 * float(np.linalg.norm(pose.translation_m)):
        raise SolveError(
            f"the right eye must be to the right of the left one: it is {across_m * 1e3:.1f} mm to its left; "
            "exchange --left and --right (live: left_device and right_device). Nothing is written"
        )


def _solve_once(views: Sequence[View], eye: str, size_px: tuple[int, int]) -> Intrinsics:
    detections = [view.corners[eye] for view in views]
    flags = 0 if len(views) >= _VIEWS_FOR_K3 else cv2.CALIB_FIX_K3
    try:
        rms, matrix, distortion, rotations, translations, deviations, *_ = cv2.calibrateCameraExtended(
            [d.points_m for d in detections],
            [d.points_px for d in detections],
            size_px,
            np.eye(3),
            np.zeros(5),
            flags=flags,
            criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-9),
        )
    except cv2.error as error:
        raise SolveError(f"{eye}: the views do not determine a camera ({' '.join(str(error).split())})") from None
    matrix, distortion = np.asarray(matrix), np.asarray(distortion).ravel()[:5]
    sigma = np.asarray(deviations).ravel()
    errors = {
        view.name: _error_px(d, matrix, distortion, np.asarray(rotation), np.asarray(translation))
        for view, d, rotation, translation in zip(views, detections, rotations, translations, strict=True)
    }
    return Intrinsics(
        size_px=size_px,
        matrix=matrix,
        distortion=distortion,
        focal_sigma_px=(float(sigma[0]), float(sigma[1])),
        centre_sigma_px=(float(sigma[2]), float(sigma[3])),
        rms_px=float(rms),
        view_rms_px=errors,
        rejected={},
    )


def _error_px(detection: Detection, matrix: Matrix, distortion: Matrix, rotation: Matrix, translation: Matrix) -> float:
    projected, _ = cv2.projectPoints(detection.points_m, rotation, translation, matrix, distortion)
    differences = np.asarray(projected).reshape(-1, 2) - detection.points_px
    return float(np.sqrt(np.mean(np.sum(differences**2, axis=1))))


def _pair_error_px(view: View, left: Intrinsics, right: Intrinsics, rotation: Matrix, translation_m: Matrix) -> float:
    """Return the RMS in the right picture when the board's pose is taken from the left one, and the reverse."""
    errors = []
    for one, other, here, there in (("left", "right", left, right), ("right", "left", right, left)):
        R, t = (rotation, translation_m) if one == "left" else (rotation.T, -rotation.T @ translation_m)
        corners = view.corners[one]
        done, turn, shift = cv2.solvePnP(corners.points_m, corners.points_px, here.matrix, here.distortion)
        if not done:
            return float("inf")
        turned = R @ np.asarray(cv2.Rodrigues(turn)[0])
        shifted = R @ np.asarray(shift).ravel() + t
        errors.append(_error_px(view.corners[other], there.matrix, there.distortion, turned, shifted))
    return float(np.sqrt(np.mean(np.square(errors))))


def _outlier(errors: dict[str, float]) -> tuple[str | None, float]:
    """Return the worst view if it is far above the median of all, and the limit."""
    limit = max(_OUTLIER_FLOOR_PX, _OUTLIER_FACTOR * float(np.median(list(errors.values()))))
    worst = max(errors, key=lambda name: errors[name])
    return (worst, limit) if errors[worst] > limit else (None, limit)
