"""Where the target is, with covariance and a 95 % interval of its distance.

The shaft of a hobby servo lies somewhere in its dead band and play; the side it came from gives where, as far as the
servo is like its data sheet. The rest of that uncertainty is in the filter's vergence, however steady it is: half a
degree is 13 cm at one metre.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.estimation.vergence_offset import VergenceOffset
from vergence_rig.geometry import GeometryError, from_version_vergence
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_TO_95_PERCENT = 1.8  # servo errors are bounded: their tails are lighter than a normal distribution has
_PLAY_SIGMA_SHARE = 0.22 / math.sqrt(3.0)
"""Dead band and play of a servo are each within a fifth or so of its data sheet; on which side it rests is modelled."""
_SHARED_NOISE = 1.6
"""Estimators that read the same pair share its noise, which the filter assumes to be independent."""


@dataclass(frozen=True)
class TargetPosition:
    """The target in rig_base (3,) [m], covariance (3, 3) [m^2], and distance with its 95 % interval [m]."""

    point_m: Array
    covariance_m2: Array
    distance_m: float
    low_m: float
    high_m: float


UNKNOWN = TargetPosition(np.full(3, math.nan), np.full((3, 3), math.nan), math.nan, math.nan, math.nan)


def joint_variances(rig: Rig) -> Array:
    """Return the variance of each axis at rest (3,) [rad^2] that is left although its play is modelled."""
    zeros = np.array([rig.zero_sigma_rad, rig.zero_sigma_rad, 0.0]) ** 2
    return zeros + np.array(
        [
            (_PLAY_SIGMA_SHARE * 0.5 * math.hypot(servo.dead_band_rad, servo.backlash_rad)) ** 2
            + servo.pulse_step_rad**2 / 12.0
            for servo in (joint.servo for _, joint in rig.joints.items())
        ]
    )


def target_position(
    estimate: TargetEstimate, kinematics: Kinematics, shaft_variances: Array, offset: VergenceOffset | None = None
) -> TargetPosition:
    """Return the target's position from the filter's estimate and the shafts' variances (3,) [rad^2].

    With an `offset` the visual encoder's variance replaces that of the pans.
    """
    left, right, tilt = shaft_variances
    if offset is not None:
        scale = offset.variance / max(left + right, 1e-12)
        left, right = left * scale, right * scale
        angles = estimate.angles_rad + np.array([0.0, offset.offset_rad, 0.0])
        estimate = replace(estimate, angles_rad=angles)
    covariance = _SHARED_NOISE * estimate.covariance
    covariance[0, 0] += 0.25 * (left + right)
    covariance[1, 1] += left + right + _of_baseline(estimate, kinematics)
    covariance[0, 1] += 0.5 * (right - left)
    covariance[1, 0] += 0.5 * (right - left)
    covariance[2, 2] += tilt
    sigma = math.sqrt(covariance[1, 1])
    near = estimate.vergence_rad + _TO_95_PERCENT * sigma
    far = estimate.vergence_rad - _TO_95_PERCENT * sigma
    low, high = (_distance(estimate, vergence_rad, kinematics) for vergence_rad in (near, far))
    version, vergence, tilt = (float(angle) for angle in estimate.angles_rad)
    try:
        point = kinematics.point_at(version, vergence, tilt)
        jacobian = kinematics.point_jacobian(from_version_vergence(version, vergence, tilt))
    except GeometryError:
        return TargetPosition(UNKNOWN.point_m, UNKNOWN.covariance_m2, math.inf, low, high)
    return TargetPosition(point, jacobian @ covariance @ jacobian.T, float(np.linalg.norm(point)), low, high)


def _of_baseline(estimate: TargetEstimate, kinematics: Kinematics) -> float:
    """Return the variance [rad^2] of the vergence that makes distances as uncertain as the baseline, relatively."""
    return (estimate.vergence_rad * kinematics.baseline_sigma_m / kinematics.baseline_m) ** 2


def _distance(estimate: TargetEstimate, vergence_rad: float, kinematics: Kinematics) -> float:
    try:
        return float(np.linalg.norm(kinematics.point_at(estimate.version_rad, vergence_rad, estimate.tilt_rad)))
    except GeometryError:
        return math.inf
