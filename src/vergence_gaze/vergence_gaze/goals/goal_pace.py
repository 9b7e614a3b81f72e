"""How fast the joints turn for a goal that bounds its speed, and how much longer that takes."""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.goals.goal import Goal
from vergence_gaze.goals.goal_resolution import ClassRequest, MotionRequest, Request, RequestedPose
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_rig.geometry import from_version_vergence

Array = npt.NDArray[np.float64]


def pace(
    goal: Goal, request: Request, history: ShaftHistory, driven: npt.NDArray[np.bool_], speed_rad_s: Array
) -> tuple[float, float]:
    """Return the largest speed of a goal [rad/s], and how much time it takes longer than at full speed [s].

    Args:
        goal: what was asked for.
        request: what it means for this head.
        history: where the joints are; not read for what may be anywhere, which may be asked for before they are known.
        driven: which joints may move (3,).
        speed_rad_s: the joints' own largest speeds (3,).
    """
    if isinstance(request, (ClassRequest, MotionRequest)):
        return goal.max_speed_rad_s, 0.0
    if isinstance(request, RequestedPose):
        wanted = request.joints_rad
    else:
        eyes = from_version_vergence(*(float(angle) for angle in request.angles_rad))
        wanted = np.array([eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad])
    travel_rad = np.abs(np.where(driven, wanted - history.reported_rad, 0.0))
    longest_rad, most_rad_s = float(travel_rad.max()), goal.max_speed_rad_s
    if goal.min_duration_s > 0 and longest_rad > 0:
        most_rad_s = min(most_rad_s, longest_rad / goal.min_duration_s)
    full_s = float((travel_rad / speed_rad_s).max())
    slow_s = max(longest_rad / most_rad_s if math.isfinite(most_rad_s) else 0.0, goal.min_duration_s)
    return most_rad_s, max(slow_s - full_s, 0.0)
