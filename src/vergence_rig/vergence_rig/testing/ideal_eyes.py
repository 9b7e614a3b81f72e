"""Formulas of ideal eyes, whose axes meet exactly: an independent reference for `vergence_rig.kinematics`."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import EyeAngles, Fixation, UnreachableError, point_at

Array = npt.NDArray[np.float64]


def eye_position(left: bool, baseline_m: float) -> Array:
    """Return an eye's centre in rig_base (3,) [m]; tilting does not move it."""
    return np.array([0.0, 0.5 * baseline_m if left else -0.5 * baseline_m, 0.0])


def gaze_for_point(point_m: Any, baseline_m: float) -> EyeAngles:
    """Return the angles that turn both axes through a point (3,) in rig_base [m].

    Raises UnreachableError for a point on the line through both eyes, or one that is not finite.
    """
    x, y, z = (float(value) for value in point_m)
    forward = math.hypot(x, z)
    if not (math.isfinite(forward) and math.isfinite(y)) or forward <= 1e-9:
        raise UnreachableError(f"point must be finite and off the baseline's line: got ({x:g}, {y:g}, {z:g}) m")
    half = 0.5 * baseline_m
    return EyeAngles(math.atan2(y - half, forward), math.atan2(y + half, forward), math.atan2(-z, x))


def fixation_point(eye_angles: EyeAngles, baseline_m: float) -> Fixation:
    """Return where the axes of ideally mounted eyes meet; raises ParallelAxesError or DivergingAxesError."""
    point_m = point_at(eye_angles.version_rad, eye_angles.vergence_rad, eye_angles.tilt_rad, baseline_m)
    return Fixation(point_m, 0.0)
