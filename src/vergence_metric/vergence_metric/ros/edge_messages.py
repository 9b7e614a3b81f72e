"""Metric I and the signed disparity as messages; of unusable images as well, with NaN for every figure."""

import math
from collections.abc import Sequence

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
        message.reason = "neither camera_info nor rig.yaml describes cameras for images of this shape: angles are NaN"
    return message


def unusable_edge_message(windows_px: Sequence[int], header: Header, pair_skew_s: float) -> EdgeVergence:
    """Return the message of a pair whose images cannot be measured."""
    count, nan = len(windows_px), [math.nan] * len(windows_px)
    return EdgeVergence(
        header=header,
        pair_skew_s=pair_skew_s,
        windows_px=list(windows_px),
        left_to_right_px=nan,
        right_to_left_px=nan,
        left_edge_count=[0] * count,
        right_edge_count=[0] * count,
        chance_left_to_right_px=nan,
        chance_right_to_left_px=nan,
        contrast_left_to_right=nan,
        contrast_right_to_left=nan,
        contrast=nan,
        robust_left_to_right_px=nan,
        robust_right_to_left_px=nan,
        status=[EdgeVergence.STATUS_UNUSABLE_IMAGES] * count,
        align_vertical_px=math.nan,
        align_roll_rad=math.nan,
    )


def unusable_error_message(estimator: str, reason: str, header: Header, pair_skew_s: float) -> VergenceError:
    """Return the message of a pair whose images cannot be measured, and why."""
    nan = math.nan
    return VergenceError(
        header=header,
        pair_skew_s=pair_skew_s,
        horizontal_px=nan,
        vertical_px=nan,
        horizontal_rad=nan,
        vertical_rad=nan,
        sigma_px=nan,
        confidence=0.0,
        estimator=estimator,
        status=VergenceError.STATUS_UNUSABLE_IMAGES,
        reason=reason,
    )
