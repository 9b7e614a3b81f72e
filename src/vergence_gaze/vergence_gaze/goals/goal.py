"""Goals of the controller, and their outcomes."""

import enum
import math
from dataclasses import dataclass


class GoalKind(enum.IntEnum):
    """As LookAt's constants."""

    POINT = 0
    PIXEL = 1
    STEREO_PIXEL = 2
    ANGLES = 3
    RELATIVE_ANGLES = 4
    CLASS = 5
    MOTION = 6


class Result(enum.IntEnum):
    """As LookAt's result constants."""

    VERGED = 0
    UNREACHABLE = 1
    LOST = 2
    LIMITS = 3
    NO_IMAGES = 4
    PREEMPTED = 6
    CANCELLED = 7
    TIMED_OUT = 8
    INVALID = 9
    AT_POINT = 10
    AMBIGUOUS = 11
    NO_FEEDBACK = 12


@dataclass(frozen=True)
class Goal:
    """One request. Pixels come as normalised, undistorted coordinates (x right, y down), points in rig_base.

    `stamp_s` is the stamp of the image that pixels were read from; NaN for the newest. `depth_m` is along the eye's
    ray, NaN if unknown. `left_eye` says which eye a single pixel is of; `extent_rad` are the angular width and height
    of the object there, NaN if unknown. While the goal is active no joint turns faster than `max_speed_rad_s`, nor so
    fast that it would take less than `min_duration_s`. Without `needs_images` a point is reached by the joints alone
    where no images arrive.
    """

    kind: GoalKind
    point_m: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    left_eye: bool = True
    left_xy: tuple[float, float] = (math.nan, math.nan)
    right_xy: tuple[float, float] = (math.nan, math.nan)
    depth_m: float = math.nan
    extent_rad: tuple[float, float] = (math.nan, math.nan)
    version_rad: float = math.nan
    vergence_rad: float = math.nan
    tilt_rad: float = math.nan
    class_name: str = ""
    stamp_s: float = math.nan
    time_limit_s: float = 0.0
    max_speed_rad_s: float = math.inf
    min_duration_s: float = 0.0
    needs_images: bool = True


@dataclass(frozen=True)
class TrackRequest:
    """What the tracker is to follow for a goal: a point (x, y) of one eye's image, in normalised coordinates.

    `extent_rad` are the angular width and height of the object there, NaN if unknown. `motion` asks for whatever moves
    next instead. `goal_id` 0 asks for no point: the tracker is free to follow what lies at the fovea.
    """

    goal_id: int
    stamp_s: float = math.nan
    left_eye: bool = True
    xy: tuple[float, float] = (math.nan, math.nan)
    extent_rad: tuple[float, float] = (math.nan, math.nan)
    motion: bool = False


@dataclass(frozen=True)
class ObjectRequest:
    """Which object the detector is to measure: one of a class ("": any), or this one of it while it is seen."""

    class_name: str = ""
    object_id: int = 0


@dataclass(frozen=True)
class Outcome:
    """How a goal ended."""

    goal_id: int
    result: Result
    reason: str
    time_s: float


class GoalError(ValueError):
    """A goal that cannot be started: INVALID or UNREACHABLE, and why."""

    def __init__(self, result: Result, reason: str) -> None:
        super().__init__(reason)
        self.result, self.reason = result, reason
