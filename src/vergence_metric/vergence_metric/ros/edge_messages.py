"""Metric I and the signed disparity as messages."""

import math

import numpy as np
from std_msgs.msg import Header

from vergence_metric.disparity import Disparity
from vergence_metric.disparity.angular_disparity import AngularDisparity
from vergence_metric.measurement.edge_metric import EdgeMetricResult
from vergence_msgs.msg import EdgeVergence, VergenceError


def edge_message(result: EdgeMetricResult, verged: bool, header: Header, pair_skew_s: float) -> EdgeVergence:
    """Return metric I of a pair and whether the eyes are verged; `header` is the left image's."""
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
    """Return the signed disparity of a pair; `angular` is None without camera models."""
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
        message.reason = "no camera_info for images of this size yet: angles are NaN"
    return message
