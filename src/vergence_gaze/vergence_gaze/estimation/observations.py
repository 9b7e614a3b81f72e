"""The controller's inputs: joints, tracks, boxes, points, contrasts. Times are seconds of one clock.

Normalised image coordinates are undistorted x/z, y/z in the eye's optical frame (x right, y down). Values that are not
known are NaN.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

SAME_PAIR_S = 0.012
"""Results of one pair, from two nodes, have stamps that differ by less."""


@dataclass(frozen=True)
class JointReport:
    """Joint positions [rad] by name, as published at `stamp_s`."""

    stamp_s: float
    positions_rad: Mapping[str, float]


@dataclass(frozen=True)
class JointResolution:
    """The smallest step of each joint [rad] by name, as the servos' driver can set it."""

    stamp_s: float
    steps_rad: Mapping[str, float]


@dataclass(frozen=True)
class TrackSighting:
    """The target of the class-free tracker: normalised left coordinates and disparity.

    `disparity_rad` is NaN while the right eye does not see it; `usable` is False while locking or lost. While
    `ambiguous`, several distances fit, and the disparity is only the likeliest one's; `candidates` are the disparities
    [rad] that a requested target may have, each with its weight. `images_fault` says why nothing in the images may be
    used, "" while they may.
    """

    stamp_s: float
    skew_s: float
    track_id: int
    lock_stamp_s: float
    left_x: float
    left_y: float
    disparity_rad: float
    sigma_rad: float
    extent_rad: float
    usable: bool
    reason: str = ""
    goal_id: int = 0
    ambiguous: bool = False
    candidates: tuple[tuple[float, float], ...] = ()
    images_fault: str = ""


@dataclass(frozen=True)
class DetectedObject:
    """An object that the detector sees: its id, which it keeps while it is seen, and its class."""

    object_id: int
    class_name: str


@dataclass(frozen=True)
class BoxSighting:
    """The detected target: its direction in each eye [rad] (right positive, down positive), NaN where unseen.

    `surface_disparity_rad` is the refined disparity of the surface inside the boxes, `surface_sigma_rad` its standard
    deviation, NaN if not refined; `extent_rad` and `extent_height_rad` are the angular width and height of the left
    box; `whole` is False for boxes cut by the border or partly hidden, whose centres are not the object's. `object_id`
    is the target's, 0 if it has none; `objects` are all that are in view.
    """

    stamp_s: float
    skew_s: float
    left_azimuth_rad: float
    left_elevation_rad: float
    right_azimuth_rad: float
    right_elevation_rad: float
    surface_disparity_rad: float
    sigma_rad: float
    extent_rad: float
    class_name: str
    usable: bool
    reason: str = ""
    whole: bool = True
    extent_height_rad: float = math.nan
    surface_sigma_rad: float = math.nan
    object_id: int = 0
    objects: tuple[DetectedObject, ...] = ()


@dataclass(frozen=True)
class PointSighting:
    """A target point in rig_base (x, y, z) [m] with the standard deviation of its direction [rad]."""

    stamp_s: float
    point_m: tuple[float, float, float]
    sigma_rad: float


@dataclass(frozen=True)
class EdgeContrast:
    """Metric I at the fovea: the contrast of its best small window, and the raw metric of that window [px]."""

    stamp_s: float
    contrast: float
    metric_px: float


@dataclass(frozen=True)
class EyeRotationObservation:
    """The cameras' true vergence [rad] in a pair, from background features, with its standard deviation.

    `usable` is False where the visual encoder has no reading; `reason` says why. `contradictory` says that the reading
    differs from the joints by more than servos and mounts can. Roll and pitch are of the right eye against the left
    one, beyond those of rig.yaml [rad].
    """

    stamp_s: float
    skew_s: float
    vergence_rad: float
    sigma_rad: float
    usable: bool = True
    reason: str = ""
    contradictory: bool = False
    roll_rad: float = math.nan
    pitch_rad: float = math.nan


Observation: TypeAlias = (
    JointReport | JointResolution | TrackSighting | BoxSighting | PointSighting | EdgeContrast | EyeRotationObservation
)
