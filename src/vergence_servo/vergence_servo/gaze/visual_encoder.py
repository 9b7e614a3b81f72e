"""The eyes' true relative rotation from matched background features: an encoder for servos that have none.

Two views of anything obey the epipolar constraint r_left' [t]x R r_right = 0 (Longuet-Higgins 1981). With the baseline
known and both eyes on one bar, R and t have four unknowns: how far the vergence differs from what the joints say, the
right camera's roll and pitch in its mount, and the left pan. Vergence shows in the constraint only through its product
with height and width in the image, so it takes many features spread over the whole view, and a good lens model.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MINIMUM_MATCHES = 30

_PRIOR_SIGMAS_RAD = np.radians([2.0, 2.0, 2.0, 0.6])
_ITERATIONS = 12
_CONVERGED_RAD = 1e-7
_STEP_RAD = 1e-6
_TUKEY = 4.7
_SMALLEST_SCALE = 1e-5


class EncoderError(ValueError):
    """Matches from which nothing can be told."""


@dataclass(frozen=True)
class RelativeRotation:
    """Vergence of the two cameras [rad] with its standard deviation, mount roll and pitch, and the share of inliers."""

    vergence_rad: float
    sigma_rad: float
    roll_rad: float
    pitch_rad: float
    inlier_share: float
    matches: int

    def is_better_than(self, sigma_rad: float) -> bool:
        """Tell whether it knows more than joints that are certain to `sigma_rad`."""
        return self.sigma_rad < sigma_rad and self.inlier_share > 0.5


def relative_rotation(left_xy: Array, right_xy: Array, pan_left_rad: float, pan_right_rad: float) -> RelativeRotation:
    """Return the relative rotation that fits the matches best.

    Args:
        left_xy: (N, 2) normalised, undistorted coordinates (x right, y down) in the left eye.
        right_xy: (N, 2) of the same features in the right eye.
        pan_left_rad: pan that the joints say, at the exposure.
        pan_right_rad: the same of the right eye.

    Raises:
        EncoderError: fewer than MINIMUM_MATCHES finite matches, or arrays that do not pair up.

    """
    if left_xy.shape != right_xy.shape or left_xy.ndim != 2 or left_xy.shape[1] != 2:
        raise EncoderError(f"matches are {left_xy.shape} and {right_xy.shape}: allowed is (N, 2) twice")
    finite = np.isfinite(left_xy).all(axis=1) & np.isfinite(right_xy).all(axis=1)
    if int(finite.sum()) < MINIMUM_MATCHES:
        raise EncoderError(f"{int(finite.sum())} matches: allowed is at least {MINIMUM_MATCHES}")
    left, right = _rays(left_xy[finite]), _rays(right_xy[finite])
    offsets, weights, scale = np.zeros(4), np.ones(len(left)), math.inf
    normal = np.eye(4)
    for _ in range(_ITERATIONS):
        residuals = _sampson(left, right, pan_left_rad, pan_right_rad, offsets)
        scale = max(1.4826 * float(np.median(np.abs(residuals))), _SMALLEST_SCALE)
        weights = _tukey(residuals / (_TUKEY * scale))
        jacobian = _jacobian(left, right, pan_left_rad, pan_right_rad, offsets)
        normal = (jacobian * weights[:, None]).T @ jacobian / scale**2 + np.diag(_PRIOR_SIGMAS_RAD**-2)
        gradient = (jacobian * weights[:, None]).T @ residuals / scale**2 + offsets / _PRIOR_SIGMAS_RAD**2
        step = np.linalg.solve(normal, gradient)
        offsets = offsets - step
        if np.abs(step).max() < _CONVERGED_RAD:
            break
    covariance = np.linalg.inv(normal)
    return RelativeRotation(
        vergence_rad=pan_right_rad - pan_left_rad + float(offsets[0]),
        sigma_rad=math.sqrt(float(covariance[0, 0])),
        roll_rad=float(offsets[1]),
        pitch_rad=float(offsets[2]),
        inlier_share=float(np.mean(weights > 0.1)),
        matches=len(left),
    )


def _rays(xy: Array) -> Array:
    """Return rays (N, 3) in the eye frame, x forward, y left, z up."""
    return np.column_stack([np.ones(len(xy)), -xy])


def _sampson(left: Array, right: Array, pan_left: float, pan_right: float, offsets: Array) -> Array:
    """Return signed Sampson distances (N,) in normalised image units."""
    vergence, roll, pitch, left_off = offsets
    pan = pan_left + left_off
    turn = _about_z(pan_right - pan_left + vergence) @ _about_y(pitch) @ _about_x(roll)
    baseline = np.array([-math.sin(pan), -math.cos(pan), 0.0])
    x, y, z = baseline
    essential = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ turn
    lines_left, lines_right = right @ essential.T, left @ essential
    constraint = np.einsum("ij,ij->i", left, lines_left)
    slope = np.sqrt((lines_left[:, 1:] ** 2).sum(axis=1) + (lines_right[:, 1:] ** 2).sum(axis=1))
    distances: Array = constraint / np.maximum(slope, 1e-12)
    return distances


def _jacobian(left: Array, right: Array, pan_left: float, pan_right: float, offsets: Array) -> Array:
    columns = [
        _sampson(left, right, pan_left, pan_right, offsets + step)
        - _sampson(left, right, pan_left, pan_right, offsets - step)
        for step in _STEP_RAD * np.eye(4)
    ]
    return np.column_stack(columns) / (2.0 * _STEP_RAD)


def _tukey(ratios: Array) -> Array:
    weights: Array = np.where(np.abs(ratios) < 1.0, (1.0 - ratios**2) ** 2, 0.0)
    return weights


def _about_x(angle: float) -> Array:
    sine, cosine = math.sin(angle), math.cos(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])


def _about_y(angle: float) -> Array:
    sine, cosine = math.sin(angle), math.cos(angle)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def _about_z(angle: float) -> Array:
    sine, cosine = math.sin(angle), math.cos(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
