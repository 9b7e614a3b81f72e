"""What gaze/goal says of a goal: what was asked for, in words too, and how it ended."""

import math

from std_msgs.msg import Header

from vergence_common.stamps import to_stamp
from vergence_gaze.goals.goal import Outcome
from vergence_gaze.ros.gaze_messages import BASE_FRAME
from vergence_msgs.action import LookAt
from vergence_msgs.msg import GazeGoal

_GOAL_FIELDS = (
    *("kind", "point", "eye", "left_x_px", "left_y_px", "right_x_px", "right_y_px", "depth_m", "width_px", "height_px"),
    *("version_rad", "vergence_rad", "tilt_rad", "class_name"),
)


def gaze_goal(request: LookAt.Goal, state: int, now_s: float, outcome: Outcome | None) -> GazeGoal:
    """Return what is published of a goal: what was asked for and, unless it is ACTIVE, how it ended."""
    message = GazeGoal(
        header=Header(stamp=to_stamp(now_s), frame_id=BASE_FRAME),
        state=state,
        request=_in_words(request),
        image_stamp=request.header.stamp,
        frame_id=request.header.frame_id,
        **{name: getattr(request, name) for name in _GOAL_FIELDS},
    )
    if outcome is not None:
        message.result, message.reason, message.time_s = int(outcome.result), outcome.reason, outcome.time_s
    return message


def _in_words(request: LookAt.Goal) -> str:
    eye = "left" if request.eye == LookAt.Goal.EYE_LEFT else "right"
    angles = ", ".join(f"{math.degrees(angle):.1f}" for angle in _angles_of(request))
    match request.kind:
        case LookAt.Goal.POINT:
            point = request.point
            return f"point ({point.x:.3f}, {point.y:.3f}, {point.z:.3f}) m in {request.header.frame_id or BASE_FRAME}"
        case LookAt.Goal.PIXEL:
            x_px, y_px = (getattr(request, f"{eye}_{axis}_px") for axis in "xy")
            return f"pixel ({x_px:.1f}, {y_px:.1f}) of the {eye} eye"
        case LookAt.Goal.STEREO_PIXEL:
            return (
                f"pixels ({request.left_x_px:.1f}, {request.left_y_px:.1f}) of the left and "
                f"({request.right_x_px:.1f}, {request.right_y_px:.1f}) of the right eye"
            )
        case LookAt.Goal.ANGLES:
            return f"version, vergence and tilt {angles} degrees"
        case LookAt.Goal.RELATIVE_ANGLES:
            return f"version, vergence and tilt {angles} degrees from where the eyes are"
        case LookAt.Goal.CLASS:
            return f"a target of class {request.class_name}"
        case LookAt.Goal.MOTION:
            return "whatever moves next"
    return f"a goal of kind {request.kind}, which does not exist"


def _angles_of(request: LookAt.Goal) -> tuple[float, float, float]:
    return request.version_rad, request.vergence_rad, request.tilt_rad
