"""What the controller says of itself every cycle, as GazeState carries it."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import GeometryError, eye_direction, eye_position, fixation_of_rays
from vergence_servo.gaze.distance import TargetPosition
from vergence_servo.gaze.goals import Outcome
from vergence_servo.gaze.phases import Phase

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GazeReport:
    """Angles are estimated, residuals (version, vergence, tilt) are what is left to turn; NaN where unknown.

    `fixation_m` (3,) is the midpoint of the gaze rays' closest approach and `miss_distance_m` how far they pass.
    """

    stamp_s: float
    phase: Phase
    reason: str
    law: str
    mode: str
    verged: bool
    target_moving: bool
    version_rad: float
    vergence_rad: float
    tilt_rad: float
    residual_rad: tuple[float, float, float]
    residual_px: float
    contrast: float
    target: TargetPosition
    fixation_m: Array
    miss_distance_m: float


@dataclass(frozen=True)
class Command:
    """One cycle's result: joint angles (3,) that were sent, None before the joints are known; and goals that ended."""

    joints_rad: Array | None
    report: GazeReport
    outcomes: tuple[Outcome, ...]


def fixation_of_joints(joints_rad: Array, baseline_m: float) -> tuple[Array, float]:
    """Return where the axes at these joint angles (3,) meet, (3,) [m], and their miss distance; NaN if nowhere."""
    try:
        fixation = fixation_of_rays(
            eye_position(True, baseline_m),
            eye_direction(joints_rad[0], joints_rad[2]),
            eye_position(False, baseline_m),
            eye_direction(joints_rad[1], joints_rad[2]),
        )
    except GeometryError:
        return np.full(3, math.nan), math.nan
    return fixation.point_m, fixation.miss_distance_m
