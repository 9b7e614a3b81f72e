"""The followed target as a message."""

import math

from std_msgs.msg import Header

from vergence_common.stamps import to_seconds, to_stamp
from vergence_metric.disparity.angular_disparity import AngularDisparity
from vergence_metric.measurement.edge_metric import EdgeMetricResult
from vergence_metric.tracking.request import TrackRequest
from vergence_metric.tracking.track import NOWHERE, Track
from vergence_msgs.msg import TargetTrack
from vergence_msgs.msg import TrackRequest as TrackRequestMessage
from vergence_rig.eye_image import EyeImage

EyeImages = tuple[EyeImage, EyeImage]


def track_message(
    track: Track,
    result: EdgeMetricResult,
    angular: AngularDisparity | None,
    images: EyeImages | None,
    header: Header,
    pair_skew_s: float,
) -> TargetTrack:
    """Return the track of a pair, in the images as they were taken.

    `angular` and `images` are None without camera models.
    """
    height, width = result.left_grey.shape
    contrast = result.target_contrast(track.surface)
    left_px, right_px = track.left_px, result.alignment.unaligned(*track.right_px, width, height)
    if images is not None:
        left_px, right_px = (_taken(image, px) for image, px in zip(images, (left_px, right_px), strict=True))
    return TargetTrack(
        header=header,
        pair_skew_s=pair_skew_s,
        goal_id=track.goal_id,
        track_id=track.track_id,
        lock_stamp=to_stamp(track.lock_stamp_s if math.isfinite(track.lock_stamp_s) else 0.0),
        left_x_px=left_px[0],
        left_y_px=left_px[1],
        right_x_px=right_px[0],
        right_y_px=right_px[1],
        disparity_px=track.disparity_px if angular is None else angular.horizontal_px,
        disparity_rad=math.nan if angular is None else angular.horizontal_rad,
        sigma_px=track.sigma_px,
        extent_width_px=track.extent_px[0],
        extent_height_px=track.extent_px[1],
        confidence=track.confidence,
        status=int(track.status),
        reason=track.reason,
        candidate_disparity_px=[disparity_px for disparity_px, _ in track.candidates],
        candidate_weight=[weight for _, weight in track.candidates],
        contrast_window_px=contrast.window_px,
        contrast=contrast.contrast,
    )


def unusable_track_message(reason: str, header: Header, pair_skew_s: float) -> TargetTrack:
    """Return the message of a pair whose images cannot be measured, and why; it has no contrast either."""
    nan = math.nan
    return TargetTrack(
        header=header,
        pair_skew_s=pair_skew_s,
        left_x_px=nan,
        left_y_px=nan,
        right_x_px=nan,
        right_y_px=nan,
        disparity_px=nan,
        disparity_rad=nan,
        sigma_px=nan,
        extent_width_px=nan,
        extent_height_px=nan,
        confidence=0.0,
        status=TargetTrack.STATUS_UNUSABLE_IMAGES,
        reason=reason,
        contrast=nan,
    )


def track_request(message: TrackRequestMessage, images: EyeImages | None) -> TrackRequest:
    """Return the request in pixels of the ideal image; of the one as it was taken without camera models."""
    if message.motion:
        return TrackRequest(message.goal_id, to_seconds(message.header.stamp), True, NOWHERE, motion=True)
    left, pixel = message.eye == TrackRequestMessage.EYE_LEFT, (message.x_px, message.y_px)
    if images is not None:
        x_px, y_px = images[0 if left else 1].to_ideal([pixel])[0]
        pixel = (float(x_px), float(y_px))
    sized = message.width_px > 0.0 and message.height_px > 0.0
    return TrackRequest(
        goal_id=message.goal_id,
        stamp_s=to_seconds(message.header.stamp),
        left_eye=left,
        pixel=pixel,
        extent_px=(message.width_px, message.height_px) if sized else None,
    )


def _taken(image: EyeImage, ideal_px: tuple[float, float]) -> tuple[float, float]:
    """Return a pixel of an ideal image in the image as it was taken; NaN for NaN."""
    x_px, y_px = image.to_camera([ideal_px])[0]
    return float(x_px), float(y_px)
