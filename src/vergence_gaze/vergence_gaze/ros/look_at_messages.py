"""The messages of gaze/look_at to and from plain values."""

import math

from vergence_common.stamps import to_seconds
from vergence_gaze.control.report import GazeReport
from vergence_gaze.goals.goal import Goal, GoalKind, Outcome
from vergence_gaze.ros.gaze_messages import point_stamped
from vergence_msgs.action import LookAt
from vergence_rig.eye_image import EyeImage


def goal(request: LookAt.Goal, point_m: tuple[float, float, float], left: EyeImage, right: EyeImage) -> Goal:
    """Return a LookAt goal; `point_m` is its point, already in rig_base. Raises ValueError for another kind or size."""
    stamp_s = to_seconds(request.header.stamp)
    return Goal(
        kind=GoalKind(request.kind),
        point_m=point_m,
        left_eye=request.eye == LookAt.Goal.EYE_LEFT,
        left_xy=left.undistorted(request.left_x_px, request.left_y_px),
        right_xy=right.undistorted(request.right_x_px, request.right_y_px),
        depth_m=request.depth_m if request.depth_m > 0 else math.nan,
        extent_rad=_extent_rad(request, left if request.eye == LookAt.Goal.EYE_LEFT else right),
        version_rad=request.version_rad,
        vergence_rad=request.vergence_rad,
        tilt_rad=request.tilt_rad,
        class_name=request.class_name,
        stamp_s=stamp_s if stamp_s > 0 else math.nan,
        time_limit_s=request.time_limit_s,
    )


def _extent_rad(request: LookAt.Goal, image: EyeImage) -> tuple[float, float]:
    """Return the angular size of a goal's object, NaN if unknown. Raises ValueError for one that no object has."""
    size_px = request.width_px, request.height_px
    if any(side < 0.0 or math.isinf(side) for side in size_px):
        raise ValueError(f"width_px and height_px must be at least 0 and finite: got {size_px[0]:g} and {size_px[1]:g}")
    if not all(side > 0.0 for side in size_px):
        return math.nan, math.nan
    return size_px[0] / image.fx_px, size_px[1] / image.fx_px


def look_at_result(outcome: Outcome, report: GazeReport | None, stamp_s: float) -> LookAt.Result:
    """Return the action's result."""
    result = LookAt.Result(result=int(outcome.result), reason=outcome.reason, time_s=outcome.time_s)
    if report is not None:
        result.fixation_point = point_stamped(report.fixation_m, stamp_s)
        result.vergence_rad = report.vergence_rad
    return result


def look_at_feedback(report: GazeReport) -> LookAt.Feedback:
    """Return the action's feedback."""
    version, vergence, tilt = (math.degrees(residual) for residual in report.residual_rad)
    return LookAt.Feedback(
        phase_name=report.phase.name.lower(),
        version_residual_deg=version,
        vergence_residual_deg=vergence,
        tilt_residual_deg=tilt,
        residual_px=report.residual_px,
        contrast=report.contrast,
    )
