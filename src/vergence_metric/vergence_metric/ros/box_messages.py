"""Results of metric II as messages."""

import importlib
import math
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_msgs.msg import Header

from vergence_metric.boxes.detections import Box, Detections
from vergence_metric.boxes.result import BoxVergenceResult
from vergence_metric.boxes.seen_object import SeenObject
from vergence_metric.boxes.target_choice import RequestedObject
from vergence_metric.boxes.target_point import TargetPoint
from vergence_msgs.msg import BoundingBox, BoxVergence, DetectedObject, ObjectRequest, StereoDetections
from vergence_rig.eye_image import EyeImage

POINT_FRAME = "rig_base"


def box_message(box: Box | None) -> BoundingBox:
    """Return a box as a message; all NaN for None."""
    if box is None:
        figures = ("x_min_px", "y_min_px", "x_max_px", "y_max_px", "score", "point_x_px", "point_y_px")
        return BoundingBox(class_id=-1, **dict.fromkeys(figures, math.nan))
    x_min, y_min, x_max, y_max = box.xyxy_px
    return BoundingBox(
        x_min_px=x_min,
        y_min_px=y_min,
        x_max_px=x_max,
        y_max_px=y_max,
        score=box.score,
        class_id=box.class_id,
        class_name=box.class_name,
        cut_left=box.cut[0],
        cut_top=box.cut[1],
        cut_right=box.cut[2],
        cut_bottom=box.cut[3],
        point_x_px=box.point_px[0],
        point_y_px=box.point_px[1],
        landmarks_x_px=[x for x, _ in box.landmarks_px],
        landmarks_y_px=[y for _, y in box.landmarks_px],
    )


def object_message(one: SeenObject, focal_px: float) -> DetectedObject:
    """Return an object in view; `focal_px` is the left camera's, NaN if unknown."""
    return DetectedObject(
        object_id=one.object_id,
        class_name=one.class_name,
        score=one.boxes.score,
        version_rad=one.version_rad,
        tilt_rad=one.tilt_rad,
        distance_m=one.distance_m,
        size_rad=one.size_px / focal_px,
    )


def requested_object(message: ObjectRequest) -> RequestedObject:
    """Return what is to be the target."""
    return RequestedObject(message.class_name, message.object_id)


def box_vergence_message(
    result: BoxVergenceResult, header: Header, pair_skew_s: float, focal_px: float = math.nan
) -> BoxVergence:
    """Return metric II of a pair; `header` is the left image's, `focal_px` the left camera's, NaN if unknown."""
    there, back = (
        [float(value) for value in values]
        for values in (result.corners.left_minus_right_px, result.corners.right_minus_left_px)
    )
    distances_m = result.point.interval_m if result.point is not None else (math.nan, math.nan)
    return BoxVergence(
        header=header,
        pair_skew_s=pair_skew_s,
        left=box_message(result.left),
        right=box_message(result.right),
        left_minus_right_top_left_x_px=there[0],
        left_minus_right_top_left_y_px=there[1],
        left_minus_right_bottom_right_x_px=there[2],
        left_minus_right_bottom_right_y_px=there[3],
        right_minus_left_top_left_x_px=back[0],
        right_minus_left_top_left_y_px=back[1],
        right_minus_left_bottom_right_x_px=back[2],
        right_minus_left_bottom_right_y_px=back[3],
        center_horizontal_px=result.center_px[0],
        center_vertical_px=result.center_px[1],
        center_horizontal_rad=result.center_rad[0],
        center_vertical_rad=result.center_rad[1],
        sigma_px=result.sigma_px,
        refined_horizontal_px=result.refined.horizontal_px,
        refined_vertical_px=result.refined.vertical_px,
        refined_sigma_px=result.refined.sigma_px,
        refined_confidence=result.refined.confidence,
        size_ratio=float(result.corners.size_ratio),
        left_azimuth_rad=result.left_rad[0],
        left_elevation_rad=result.left_rad[1],
        right_azimuth_rad=result.right_rad[0],
        right_elevation_rad=result.right_rad[1],
        distance_m=result.point.distance_m if result.point is not None else math.nan,
        distance_low_m=distances_m[0],
        distance_high_m=distances_m[1],
        class_name=result.class_name,
        object_id=result.object_id,
        choice_reason=result.choice_reason,
        objects=[object_message(one, focal_px) for one in result.objects],
        status=int(result.status),
        reason=result.reason,
    )


def detections_message(result: BoxVergenceResult, header: Header, pair_skew_s: float) -> StereoDetections:
    """Return all detections of both eyes."""
    return StereoDetections(
        header=header,
        pair_skew_s=pair_skew_s,
        left=[box_message(box) for box in result.left_detections],
        right=[box_message(box) for box in result.right_detections],
    )


def point_message(point: TargetPoint, header: Header) -> PoseWithCovarianceStamped:
    """Return where the target is, in rig_base; its orientation is unknown, with a covariance of a whole turn."""
    message = PoseWithCovarianceStamped(header=Header(stamp=header.stamp, frame_id=POINT_FRAME))
    place = message.pose.pose.position
    place.x, place.y, place.z = (float(value) for value in point.point_m)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = point.covariance_m2
    covariance[3:, 3:] = np.eye(3) * math.pi**2 / 3
    message.pose.covariance = covariance.ravel()
    return message


def vision_type() -> Any:
    """Return vision_msgs' Detection2DArray; None where vision_msgs is not installed."""
    try:
        return importlib.import_module("vision_msgs.msg").Detection2DArray
    except ImportError:
        return None


def vision_message(detections: Detections, image: EyeImage | None, header: Header) -> Any:
    """Return one eye's detections as vision_msgs/Detection2DArray, in its image as it was taken.

    Only where `vision_type` is one. `image` is None without camera models.
    """
    kinds = importlib.import_module("vision_msgs.msg")
    message = kinds.Detection2DArray(header=header)
    for box in detections:
        detection = kinds.Detection2D(header=header)
        x_min, y_min, x_max, y_max = box.xyxy_px
        if image is not None:
            corners = image.to_camera([(x_min, y_min), (x_max, y_min), (x_min, y_max), (x_max, y_max)])
            (x_min, y_min), (x_max, y_max) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        detection.bbox.center.position.x = 0.5 * (x_min + x_max)
        detection.bbox.center.position.y = 0.5 * (y_min + y_max)
        detection.bbox.size_x, detection.bbox.size_y = x_max - x_min, y_max - y_min
        hypothesis = kinds.ObjectHypothesisWithPose()
        hypothesis.hypothesis.class_id, hypothesis.hypothesis.score = box.class_name, box.score
        detection.results.append(hypothesis)
        message.detections.append(detection)
    return message
