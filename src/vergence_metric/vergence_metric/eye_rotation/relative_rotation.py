"""The eyes' relative rotation from matched features: an encoder for servos that have none.

Two views of a scene obey the epipolar constraint r_left' [t]x R r_right = 0 (Longuet-Higgins 1981). The baseline is
the bar that carries both eyes, so that R and t have five unknowns: the differences of vergence and left pan from the
joint angles, the right camera's roll and pitch and the left one's roll in their mounts. Vergence enters the constraint
only through its product with height and width in the image: it needs features spread over the whole view, and a good
lens model. Near and far features are equally useful; none has to be at infinity.

Both focal lengths and lens distortions are estimated too, within the uncertainty of their calibration. The covariance
is that of clustered residuals (Liang and Zeger 1986): errors of features on one object are correlated, so that a region
of the image counts once, however many corners it has.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MIN_MATCHES = 30
UNKNOWNS = ("vergence", "right_roll", "right_pitch", "pan_left", "left_roll")
"""What is estimated, in the order of corrections and covariances: corrections to the joint angles [rad]."""

_ITERATIONS = 15
_CONVERGED_RAD = 1e-6
_STEP_RAD = 1e-6
_TUKEY = 4.7
_MIN_SCALE = 1e-5
_REGION_RAD = 0.16
_REGIONS_FOR_CLUSTERING = 6.0
_SHARED_NOISE = 1.3
"""Factor on the variance for errors that regions share, of pixel grid and compression; fitted on rendered rooms."""


class EncoderError(ValueError):
    """Matches from which no rotation can be estimated."""


@dataclass(frozen=True)
class RigPrior:
    """Standard deviations of the prior.

    Angles are in radians, `focal` is relative, `distortion` is of the lens's k1, `centre_rad` of each principal point.
    """

    vergence_rad: float = math.radians(2.0)
    mount_rad: float = math.radians(2.0)
    pan_rad: float = math.radians(0.6)
    focal: float = 0.001
    distortion: float = 0.002
    centre_rad: float = 0.0

    def precisions(self) -> Array:
        """Return 1 / variance of each estimated quantity (9,)."""
        angles = (self.vergence_rad, self.mount_rad, self.mount_rad, self.pan_rad, self.mount_rad)
        lenses = (self.focal, self.distortion, self.focal, self.distortion)
        return np.array([*angles, *(max(value, 1e-9) for value in lenses)]) ** -2.0


@dataclass(frozen=True)
class RelativeRotation:
    """Vergence of the two cameras [rad] with its standard deviation, and the quality of the fit.

    `corrections_rad` (5,) and `covariance_rad2` (5, 5) are of the UNKNOWNS; `scale_rad` is the robust scale of
    the residuals.
    """

    vergence_rad: float
    sigma_rad: float
    corrections_rad: Array
    covariance_rad2: Array
    inlier_share: float
    matches: int
    scale_rad: float

    @property
    def roll_rad(self) -> float:
        """The right camera's roll in its mount."""
        return float(self.corrections_rad[1])

    @property
    def pitch_rad(self) -> float:
        """The right camera's pitch in its mount, beyond the left one's."""
        return float(self.corrections_rad[2])

    @property
    def inliers(self) -> int:
        """Number of matches that agree."""
        return round(self.inlier_share * self.matches)


def relative_rotation(
    left_xy: Array, right_xy: Array, pan_left_rad: float, pan_right_rad: float, prior: RigPrior | None = None
) -> RelativeRotation:
    """Return the relative rotation that best fits the matches.

    Args:
        left_xy: (N, 2) normalised, undistorted coordinates (x right, y down) in the left eye.
        right_xy: (N, 2) of the same features in the right eye.
        pan_left_rad: pan of the left joint at the exposure.
        pan_right_rad: pan of the right joint at the exposure.
        prior: uncertainty of joints, mounts and calibration; None for the defaults.

    Raises:
        EncoderError: fewer than MIN_MATCHES finite matches, or arrays that do not pair up.

    """
    prior = prior or RigPrior()
    if left_xy.shape != right_xy.shape or left_xy.ndim != 2 or left_xy.shape[1] != 2:
        raise EncoderError(f"left_xy and right_xy must both be (N, 2): got {left_xy.shape} and {right_xy.shape}")
    finite = np.isfinite(left_xy).all(axis=1) & np.isfinite(right_xy).all(axis=1)
    if int(finite.sum()) < MIN_MATCHES:
        raise EncoderError(f"the number of finite matches must be at least {MIN_MATCHES}: got {int(finite.sum())}")
    left_xy, right_xy, pans = left_xy[finite], right_xy[finite], (pan_left_rad, pan_right_rad)
    precisions = prior.precisions()
    state = np.zeros(precisions.size)
    for _ in range(_ITERATIONS):
        residuals = _sampson(left_xy, right_xy, pans, state)
        scale = max(1.4826 * float(np.median(np.abs(residuals))), _MIN_SCALE)
        weights = _tukey(residuals / (_TUKEY * scale))
        jacobian = _jacobian(left_xy, right_xy, pans, state)
        normal = (jacobian * weights[:, None]).T @ jacobian / scale**2 + np.diag(precisions)
        gradient = (jacobian * weights[:, None]).T @ residuals / scale**2 + state * precisions
        step = np.linalg.solve(normal, gradient)
        state = state - step
        if np.abs(step[:5]).max() < _CONVERGED_RAD:
            break
    score = jacobian * (weights * _sampson(left_xy, right_xy, pans, state))[:, None] / scale**2
    inverse = np.asarray(np.linalg.inv(normal), np.float64)
    covariance = _clustered(inverse, score, left_xy, precisions)[:5, :5]
    covariance *= _SHARED_NOISE
    covariance[0, 0] += 2.0 * prior.centre_rad**2
    return RelativeRotation(
        vergence_rad=pan_right_rad - pan_left_rad + float(state[0]),
        sigma_rad=math.sqrt(float(covariance[0, 0])),
        corrections_rad=state[:5],
        covariance_rad2=covariance,
        inlier_share=float(np.mean(weights > 0.1)),
        matches=len(left_xy),
        scale_rad=scale,
    )


def _clustered(inverse: Array, score: Array, left_xy: Array, precisions: Array) -> Array:
    """Return the covariance of the fit with correlated errors of the matches in one region of the left image."""
    _, region = np.unique(np.floor(left_xy / _REGION_RAD), axis=0, return_inverse=True)
    regions = int(region.max()) + 1
    sums = np.zeros((regions, score.shape[1]))
    np.add.at(sums, region.ravel(), score)
    clustered = inverse @ (sums.T @ sums * regions / max(regions - 5.0, 1.0) + np.diag(precisions)) @ inverse
    # With few regions the spread between them is uncertain: the fit's own covariance is mixed in.
    share = regions / (regions + _REGIONS_FOR_CLUSTERING)
    mixed: Array = share * clustered + (1.0 - share) * inverse
    return mixed if mixed[0, 0] > inverse[0, 0] else inverse


def _rays(xy: Array) -> Array:
    """Return rays (N, 3) in the eye frame, x forward, y left, z up."""
    return np.column_stack([np.ones(len(xy)), -xy])


def _sampson(left_xy: Array, right_xy: Array, pans: tuple[float, float], state: Array) -> Array:
    """Return signed Sampson distances (N,) in normalised image units."""
    vergence, right_roll, right_pitch, pan_left, left_roll = state[:5]
    left, right = _rays(_distorted(left_xy, *state[5:7])), _rays(_distorted(right_xy, *state[7:9]))
    pan = pans[0] + pan_left
    unroll = _about_x(left_roll).T
    turn = unroll @ _about_z(pans[1] - pans[0] + vergence) @ _about_y(right_pitch) @ _about_x(right_roll)
    x, y, z = unroll @ (-math.sin(pan), -math.cos(pan), 0.0)
    essential = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ turn
    lines_left, lines_right = right @ essential.T, left @ essential
    constraint = np.einsum("ij,ij->i", left, lines_left)
    slope = np.sqrt((lines_left[:, 1:] ** 2).sum(axis=1) + (lines_right[:, 1:] ** 2).sum(axis=1))
    distances: Array = constraint / np.maximum(slope, 1e-12)
    return distances


def _distorted(xy: Array, focal: float, distortion: float) -> Array:
    """Return coordinates (N, 2) with a relative change of focal length and a change of k1."""
    square = (xy**2).sum(axis=1, keepdims=True)
    return np.asarray(xy * (1.0 + focal + distortion * square))


def _jacobian(left_xy: Array, right_xy: Array, pans: tuple[float, float], state: Array) -> Array:
    columns = [
        _sampson(left_xy, right_xy, pans, state + step) - _sampson(left_xy, right_xy, pans, state - step)
        for step in _STEP_RAD * np.eye(state.size)
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
