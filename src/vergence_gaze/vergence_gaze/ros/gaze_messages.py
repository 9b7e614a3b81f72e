"""The controller's messages to and from its plain values."""

import math

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import Point, PointStamped, Transform
from sensor_msgs.msg import CameraInfo, JointState
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from vergence_common.joint_states import MergedJoints
from vergence_common.stamps import to_seconds, to_stamp
from vergence_gaze.control.report import GazeReport
from vergence_gaze.estimation.observations import (
    BoxSighting,
    DetectedObject,
    EdgeContrast,
    EyeRotationObservation,
    JointReport,
    JointResolution,
    TrackSighting,
)
from vergence_gaze.goals.goal import ObjectRequest, TrackRequest
from vergence_msgs.msg import BoxVergence, EdgeVergence, EyeRotation, GazeState, TargetTrack
from vergence_msgs.msg import ObjectRequest as ObjectRequestMessage
from vergence_msgs.msg import TrackRequest as TrackRequestMessage
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import EyeImage
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import JOINT_NAMES
from vergence_rig.verged import best_small_window

Array = npt.NDArray[np.float64]

BASE_FRAME = "rig_base"
_RAY_M = 2.0


def joint_report(joints: MergedJoints) -> JointReport:
    """Return the angles of all joints by name."""
    return JointReport(joints.stamp_ns * 1e-9, dict(zip(JOINT_NAMES, joints.angles_rad, strict=True)))


def joint_resolution(message: JointState) -> JointResolution:
    """Return the smallest step of each joint, which servo_node publishes as positions."""
    return JointResolution(to_seconds(message.header.stamp), dict(zip(message.name, message.position, strict=False)))


def track_sighting(message: TargetTrack, left_image: EyeImage) -> TrackSighting:
    """Return the track in normalised coordinates."""
    both = message.status in (TargetTrack.STATUS_OK, TargetTrack.STATUS_AMBIGUOUS)
    found = both or message.status == TargetTrack.STATUS_OCCLUDED
    x, y = left_image.undistorted(message.left_x_px, message.left_y_px) if found else (math.nan, math.nan)
    candidates = zip(message.candidate_disparity_px, message.candidate_weight, strict=True)
    return TrackSighting(
        stamp_s=to_seconds(message.header.stamp),
        skew_s=message.pair_skew_s,
        track_id=message.track_id,
        lock_stamp_s=to_seconds(message.lock_stamp),
        left_x=x,
        left_y=y,
        disparity_rad=message.disparity_rad if both else math.nan,
        sigma_rad=message.sigma_px / left_image.fx_px,
        extent_rad=message.extent_width_px / left_image.fx_px,
        usable=found and math.isfinite(x) and math.isfinite(y),
        reason=message.reason,
        goal_id=message.goal_id,
        ambiguous=message.status == TargetTrack.STATUS_AMBIGUOUS,
        candidates=tuple((math.atan(x) - math.atan(x - px / left_image.fx_px), weight) for px, weight in candidates),
        images_fault=message.reason if message.status == TargetTrack.STATUS_UNUSABLE_IMAGES else "",
    )


def track_request(request: TrackRequest, images: tuple[EyeImage, EyeImage]) -> TrackRequestMessage:
    """Return the request in raw pixels of the eye's image."""
    message = TrackRequestMessage(goal_id=request.goal_id, motion=request.motion)
    if request.goal_id and not request.motion:
        image = images[0 if request.left_eye else 1]
        message.header.stamp = to_stamp(request.stamp_s)
        message.eye = TrackRequestMessage.EYE_LEFT if request.left_eye else TrackRequestMessage.EYE_RIGHT
        x_px, y_px = image.distort([request.xy])[0]
        message.x_px, message.y_px = float(x_px), float(y_px)
        if np.isfinite(request.extent_rad).all():
            message.width_px, message.height_px = (image.fx_px * extent for extent in request.extent_rad)
    return message


def object_request(request: ObjectRequest, now_s: float) -> ObjectRequestMessage:
    """Return what the detector is asked for."""
    header = Header(stamp=to_stamp(now_s))
    return ObjectRequestMessage(header=header, class_name=request.class_name, object_id=request.object_id)


def box_sighting(message: BoxVergence, focal_px: float) -> BoxSighting:
    """Return the detected target."""
    seen = (
        BoxVergence.STATUS_OK,
        BoxVergence.STATUS_LEFT_ONLY,
        BoxVergence.STATUS_RIGHT_ONLY,
        BoxVergence.STATUS_CUT,
        BoxVergence.STATUS_OCCLUDED,
    )
    return BoxSighting(
        stamp_s=to_seconds(message.header.stamp),
        skew_s=message.pair_skew_s,
        left_azimuth_rad=message.left_azimuth_rad,
        left_elevation_rad=message.left_elevation_rad,
        right_azimuth_rad=message.right_azimuth_rad,
        right_elevation_rad=message.right_elevation_rad,
        surface_disparity_rad=math.atan(message.refined_horizontal_px / focal_px),
        sigma_rad=message.sigma_px / focal_px,
        extent_rad=(message.left.x_max_px - message.left.x_min_px) / focal_px,
        class_name=message.class_name,
        usable=message.status in seen
        and (math.isfinite(message.left_azimuth_rad) or math.isfinite(message.right_azimuth_rad)),
        reason=message.reason,
        whole=message.status not in (BoxVergence.STATUS_CUT, BoxVergence.STATUS_OCCLUDED),
        surface_sigma_rad=message.refined_sigma_px / focal_px,
        extent_height_rad=(message.left.y_max_px - message.left.y_min_px) / focal_px,
        object_id=message.object_id,
        objects=tuple(DetectedObject(one.object_id, one.class_name) for one in message.objects),
    )


def track_contrast(message: TargetTrack) -> EdgeContrast:
    """Return the least contrast of the small windows, which comes with the track."""
    return EdgeContrast(to_seconds(message.header.stamp), message.contrast, math.nan)


def edge_contrast(message: EdgeVergence) -> EdgeContrast:
    """Return the least contrast of the small windows, which show vergence best, and the raw metric of that window."""
    stamp_s, best = to_seconds(message.header.stamp), best_small_window(message.windows_px, message.contrast)
    if best is None:
        return EdgeContrast(stamp_s, math.nan, math.nan)
    metric_px = 0.5 * (message.left_to_right_px[best] + message.right_to_left_px[best])
    return EdgeContrast(stamp_s, message.contrast[best], metric_px)


def eye_rotation(message: EyeRotation) -> EyeRotationObservation:
    """Return the visual encoder's reading."""
    _, right_roll, right_pitch, _, left_roll = message.corrections_rad
    return EyeRotationObservation(
        stamp_s=to_seconds(message.header.stamp),
        skew_s=message.pair_skew_s,
        vergence_rad=message.vergence_rad,
        sigma_rad=message.sigma_rad,
        usable=message.status == EyeRotation.STATUS_OK,
        reason=message.reason,
        contradictory=message.status == EyeRotation.STATUS_CONTRADICTORY,
        roll_rad=float(right_roll - left_roll),
        pitch_rad=float(right_pitch),
    )


def camera_model(message: CameraInfo) -> CameraModel:
    """Return the camera of a CameraInfo; raises CameraModelError if it is not calibrated."""
    return CameraModel.from_camera_info_values(
        message.width, message.height, message.k, message.d, message.distortion_model
    )


def gaze_state(report: GazeReport, now_s: float) -> GazeState:
    """Return the state message of a control cycle at `now_s`."""
    version, vergence, tilt = report.residual_rad
    return GazeState(
        header=Header(stamp=to_stamp(report.stamp_s), frame_id=BASE_FRAME),
        cycle_stamp=to_stamp(now_s),
        phase=int(report.phase),
        phase_name=report.phase.name.lower(),
        reason=report.reason,
        attention=report.attention,
        law=report.law,
        mode=report.mode,
        verged=report.verged,
        target_moving=report.target_moving,
        version_rad=report.version_rad,
        vergence_rad=report.vergence_rad,
        tilt_rad=report.tilt_rad,
        version_residual_rad=version,
        vergence_residual_rad=vergence,
        tilt_residual_rad=tilt,
        residual_px=report.residual_px,
        contrast=report.contrast,
        target=point(report.target.point_m),
        target_covariance=report.target.covariance_m2.reshape(-1),
        distance_m=report.target.distance_m,
        distance_low_m=report.target.low_m,
        distance_high_m=report.target.high_m,
        miss_distance_m=report.miss_distance_m,
    )


def point(point_m: Array) -> Point:
    """Return a (3,) point."""
    x, y, z = (float(value) for value in point_m)
    return Point(x=x, y=y, z=z)


def point_stamped(point_m: Array, stamp_s: float) -> PointStamped:
    """Return a (3,) point in rig_base."""
    return PointStamped(header=Header(stamp=to_stamp(stamp_s), frame_id=BASE_FRAME), point=point(point_m))


def gaze_markers(angles_rad: Array, fixation_m: Array, kinematics: Kinematics, stamp_s: float) -> MarkerArray:
    """Return the two gaze rays, to the fixation point where there is one, and a ball on it, for RViz."""
    header = Header(stamp=to_stamp(stamp_s), frame_id=BASE_FRAME)
    meets = bool(np.isfinite(fixation_m).all())
    markers = []
    for number, (left, pan) in enumerate(((True, angles_rad[0]), (False, angles_rad[1]))):
        ray = Marker(header=header, ns="gaze", id=number, type=Marker.ARROW, action=Marker.ADD)
        origin, axis = kinematics.lens(left, pan, angles_rad[2]), kinematics.axis(pan, angles_rad[2])
        length = float(np.linalg.norm(fixation_m - origin)) if meets else _RAY_M
        ray.points = [point(origin), point(origin + min(length, _RAY_M) * axis)]
        ray.scale.x, ray.scale.y, ray.scale.z = 0.004, 0.01, 0.02
        ray.pose.orientation.w = 1.0
        ray.color.r, ray.color.g, ray.color.b, ray.color.a = (0.1, 0.5, 1.0, 0.9) if left else (1.0, 0.4, 0.1, 0.9)
        markers.append(ray)
    ball = Marker(header=header, ns="gaze", id=2, type=Marker.SPHERE)
    ball.action = Marker.ADD if meets else Marker.DELETE
    if meets:
        ball.pose.position = point(fixation_m)
    ball.pose.orientation.w = 1.0
    ball.scale.x = ball.scale.y = ball.scale.z = 0.02
    ball.color.g, ball.color.a = 0.9, 0.9
    return MarkerArray(markers=[*markers, ball])


def transformed_point(transform: Transform, point_in: Point) -> tuple[float, float, float]:
    """Return a point moved by a geometry_msgs/Transform."""
    w, x, y, z = (transform.rotation.w, transform.rotation.x, transform.rotation.y, transform.rotation.z)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    offset = (transform.translation.x, transform.translation.y, transform.translation.z)
    moved = rotation @ (point_in.x, point_in.y, point_in.z) + offset
    return float(moved[0]), float(moved[1]), float(moved[2])
