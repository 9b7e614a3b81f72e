"""Results of the pure metric as messages."""

import math

import numpy as np
from std_msgs.msg import Header

from vergence_common.stamps import to_stamp
from vergence_metric.disparity import Disparity
from vergence_metric.eye_rotation.encoder import EyeRotationReading
from vergence_metric.measurement.edge_metric import EdgeMetricResult
from vergence_metric.pairs.viewing_angles import AngularDisparity
from vergence_metric.tracking.track import Track
from vergence_msgs.msg import EdgeVergence, EyeRotation, TargetTrack, VergenceError


def edge_message(result: EdgeMetricResult, verged: bool, header: Header, pair_skew_s: float) -> EdgeVergence:
    """Return metric I of a pair and whether it is judged verged; `header` is the left image's."""
    return EdgeVergence(
        header=header,
        pair_skew_s=pair_skew_s,
        windows_px=result.windows_px,
        left_to_right_px=result.left_to_right_px,
        right_to_left_px=result.right_to_left_px,
        left_edge_count=result.left_edge_count.astype(np.uint32),
        right_edge_count=result.right_edge_count.astype(np.uint32),
        chance_left_to_right_px=result.chance_left_to_right_px,
        chance_right_to_left_px=result.chance_right_to_left_px,
        contrast_left_to_right=result.contrast_left_to_right,
        contrast_right_to_left=result.contrast_right_to_left,
        contrast=result.contrast,
        robust_left_to_right_px=result.robust_left_to_right_px,
        robust_right_to_left_px=result.robust_right_to_left_px,
        status=result.status,
        align_mode=result.alignment.mode,
        align_vertical_px=result.alignment.vertical_px,
        align_roll_rad=result.alignment.roll_rad,
        align_bounded=result.alignment.bounded,
    )


def error_message(
    disparity: Disparity, angular: AngularDisparity | None, header: Header, pair_skew_s: float
) -> VergenceError:
    """Return the signed disparity of a pair; `angular` is None while the cameras are not described."""
    message = VergenceError(
        header=header,
        pair_skew_s=pair_skew_s,
        horizontal_px=disparity.horizontal_px if angular is None else angular.horizontal_px,
        vertical_px=disparity.vertical_px if angular is None else angular.vertical_px,
        horizontal_rad=math.nan if angular is None else angular.horizontal_rad,
        vertical_rad=math.nan if angular is None else angular.vertical_rad,
        sigma_px=disparity.sigma_px,
        confidence=disparity.confidence,
        estimator=disparity.estimator,
        status=int(disparity.status),
        reason=disparity.reason,
    )
    if angular is None and disparity.ok:
        message.status = VergenceError.STATUS_NO_CAMERA_INFO
        message.reason = "no camera_info for these images yet: angles are NaN"
    return message


def track_message(
    track: Track, result: EdgeMetricResult, angular: AngularDisparity | None, header: Header, pair_skew_s: float
) -> TargetTrack:
    """Return where the target is in the images as they were taken; `angular` is None without camera models."""
    height, width = result.left_grey.shape
    right_x_px, right_y_px = result.alignment.unaligned(*track.right_px, width, height)
    return TargetTrack(
        header=header,
        pair_skew_s=pair_skew_s,
        track_id=track.track_id,
        lock_stamp=to_stamp(track.lock_stamp_s if math.isfinite(track.lock_stamp_s) else 0.0),
        left_x_px=track.left_px[0],
        left_y_px=track.left_px[1],
        right_x_px=right_x_px,
        right_y_px=right_y_px,
        disparity_px=track.disparity_px if angular is None else angular.horizontal_px,
        disparity_rad=math.nan if angular is None else angular.horizontal_rad,
        sigma_px=track.sigma_px,
        extent_width_px=track.extent_px[0],
        extent_height_px=track.extent_px[1],
        confidence=track.confidence,
        status=int(track.status),
        reason=track.reason,
    )


def eye_rotation_message(reading: EyeRotationReading, header: Header, pair_skew_s: float) -> EyeRotation:
    """Return what the visual encoder read in a pair; angles are NaN unless they are to be believed."""
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
