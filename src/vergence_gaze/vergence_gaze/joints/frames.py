"""Points of the camera frames in rig_base, with the joint angles at their own stamp."""

import math
from typing import Any

import numpy as np

from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_rig.geometry import ROTATION_EYE_FROM_OPTICAL
from vergence_rig.kinematics import Kinematics

FRAMES = (
    "rig_base",
    "left_camera",
    "right_camera",
    "left_camera_optical_frame",
    "right_camera_optical_frame",
)
"""Frames that need no tf2. An empty name is rig_base."""


class FrameError(ValueError):
    """A frame that cannot be transformed to rig_base."""


def point_in_rig(
    point_m: Any, frame: str, stamp_s: float, history: ShaftHistory, kinematics: Kinematics
) -> tuple[float, float, float]:
    """Return a point (3,) of `frame` at `stamp_s` (NaN: now) in rig_base [m]. Raises FrameError."""
    name = frame.rsplit("/", 1)[-1] or "rig_base"
    if name not in FRAMES:
        raise FrameError(f"the frame must be one of {', '.join(FRAMES)} where tf2_ros is not installed: got {frame!r}")
    if name == "rig_base":
        x, y, z = point_m
        return float(x), float(y), float(z)
    if not history.known:
        raise FrameError(f"the frame must be rig_base until joint_states arrive: got {frame!r}")
    known = math.isfinite(stamp_s) and history.covers(stamp_s)
    pan_left, pan_right, tilt = history.shaft_at(stamp_s) if known else history.shaft_rad
    left = name.startswith("left")
    pan = pan_left if left else pan_right
    turn = kinematics.rotation_rig_from_camera(left, pan, tilt)
    if not name.endswith("optical_frame"):
        turn = turn @ ROTATION_EYE_FROM_OPTICAL.T
    x, y, z = kinematics.lens(left, pan, tilt) + turn @ np.asarray(point_m, dtype=float)
    return float(x), float(y), float(z)
