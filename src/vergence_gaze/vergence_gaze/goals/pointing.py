"""Pointing an axis of the head at a point, as control_msgs/PointHead asks for it: the axes are those of the eyes."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from vergence_gaze.goals.goal import GoalError, Result
from vergence_rig.geometry import angle_between
from vergence_rig.kinematics import Kinematics

Array = npt.NDArray[np.float64]

_TOLERANCE_RAD = math.radians(1.0)
_AXES = {
    "left_camera": (1.0, 0.0, 0.0),
    "right_camera": (1.0, 0.0, 0.0),
    "left_camera_optical_frame": (0.0, 0.0, 1.0),
    "right_camera_optical_frame": (0.0, 0.0, 1.0),
}
"""The optical axis in each frame that can be pointed."""


def check_axis(frame: str, axis: Sequence[float]) -> None:
    """Raise GoalError unless `axis` (3,) of `frame` is an eye's optical axis.

    No frame stands for both eyes, and no axis, (0, 0, 0), for the optical one. Both eyes look at the point either way.
    """
    name = frame.rsplit("/", 1)[-1]
    if name and name not in _AXES:
        allowed = ", ".join(_AXES)
        raise GoalError(
            Result.INVALID, f"pointing_frame must be empty, for both eyes, or one of {allowed}: got '{frame}'"
        )
    if not any(axis):
        return
    if not name:
        raise GoalError(Result.INVALID, "pointing_axis must be (0, 0, 0) where pointing_frame is empty, for both eyes")
    wanted = _AXES[name]
    if not all(map(math.isfinite, axis)) or not angle_between(np.asarray(axis, float), wanted) <= _TOLERANCE_RAD:
        raise GoalError(
            Result.INVALID,
            f"pointing_axis must be {wanted}, the optical axis of {name}, or (0, 0, 0): got {tuple(axis)}",
        )


def pointing_error_rad(frame: str, point_m: Sequence[float], eyes_rad: Array, kinematics: Kinematics) -> float:
    """Return the angle between a point (3,) in rig_base and the optical axis [rad]; the larger of both without a frame.

    Args:
        frame: pointing_frame, as `check_axis` allows it.
        point_m: the point.
        eyes_rad: pan_left, pan_right, tilt (3,), as eye angles.
        kinematics: of the head.
    """
    name = frame.rsplit("/", 1)[-1]
    errors = []
    for left in (True, False):
        if name and name.startswith("left") is not left:
            continue
        pan, tilt = float(eyes_rad[0 if left else 1]), float(eyes_rad[2])
        ray = np.asarray(point_m, float) - kinematics.lens(left, pan, tilt)
        errors.append(angle_between(ray, kinematics.axis(pan, tilt)))
    return max(errors)
