"""The measured rotation of the eyes as a message."""

import math

import numpy as np
from std_msgs.msg import Header

from vergence_metric.eye_rotation.encoder import EyeRotationReading
from vergence_msgs.msg import EyeRotation


def eye_rotation_message(reading: EyeRotationReading, header: Header, pair_skew_s: float) -> EyeRotation:
    """Return the visual encoder's reading of a pair; angles are NaN unless its status is OK."""
    rotation = reading.rotation
    message = EyeRotation(
        header=header,
        pair_skew_s=pair_skew_s,
        vergence_rad=math.nan,
        sigma_rad=math.nan,
        joint_vergence_rad=reading.joint_vergence_rad,
        corrections_rad=np.full(5, math.nan),
        covariance_rad2=np.full(25, math.nan),
        corners=reading.corners,
        matches=reading.matches,
        inliers=rotation.inliers if rotation else 0,
        residual_px=reading.residual_px,
        took_s=reading.took_s,
        status=int(reading.status),
        reason=reading.reason,
    )
    if reading.ok and rotation is not None:
        message.vergence_rad, message.sigma_rad = rotation.vergence_rad, rotation.sigma_rad
        message.corrections_rad = rotation.corrections_rad
        message.covariance_rad2 = rotation.covariance_rad2.reshape(-1)
    return message
