"""The demo's stations: the paper's two experiments, targets at other places, and a moving one."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt


def _at(distance_m: float, azimuth_deg: float, elevation_deg: float) -> tuple[float, float, float]:
    """Return the point in rig_base at a distance from its origin; azimuth left positive, elevation up positive."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    return (
        distance_m * math.cos(elevation) * math.cos(azimuth),
        distance_m * math.cos(elevation) * math.sin(azimuth),
        distance_m * math.sin(elevation),
    )


@dataclass(frozen=True)
class Station:
    """One target to verge on.

    Attributes:
        name: its name in the table, the images and summary.json.
        title: one line for the report.
        target: the simulator's object, "cube" or "marker".
        place_m: its centre in rig_base [m]; None for the fixation point that the controller computed.
        mode: the controller's mode, left_held (the paper's) or both_eyes.
        start_version_deg, start_vergence_deg, start_tilt_deg: the eyes' angles before the target is shown.
        by_class: the goal is the detected class `target` instead of a click on it.
        distractor_m: place of the simulator's distractor in rig_base [m]; None for none.
        motion: the simulator's motion parameters by name; empty for a static target.
        hold_s: time for which the eyes must stay verged.
    """

    name: str
    title: str
    target: str
    place_m: tuple[float, float, float] | None
    mode: str = "both_eyes"
    start_version_deg: float = 0.0
    start_vergence_deg: float = 1.0
    start_tilt_deg: float = 0.0
    by_class: bool = False
    distractor_m: tuple[float, float, float] | None = None
    motion: Mapping[str, float | str] = field(default_factory=dict)
    hold_s: float = 2.0

    @property
    def moving(self) -> bool:
        """True if the target moves."""
        return bool(self.motion)

    @property
    def has_boxes(self) -> bool:
        """True if metric II can measure the target: the shipped detector's only class is the cube."""
        return self.target == "cube"


def cube_held(baseline_m: float) -> Station:
    """Return the paper's simulation experiment: the left camera on the cube and held, the right one turns."""
    pan_left_deg = -2.0
    distance_m = 0.6
    left_eye: npt.NDArray[np.float64] = np.array([0.0, baseline_m / 2, 0.0])
    axis = np.array([math.cos(math.radians(pan_left_deg)), math.sin(math.radians(pan_left_deg)), 0.0])
    x, y, z = (left_eye + distance_m * axis).tolist()
    return Station(
        "paper_cube",
        "The paper's simulation: the left camera stays on a Rubik's cube, the right one turns until vergence",
        "cube",
        (x, y, z),
        mode="left_held",
        # The right eye starts parallel to the left one.
        start_version_deg=pan_left_deg,
        start_vergence_deg=0.0,
    )


def marker_80_80() -> Station:
    """Return the paper's hardware experiment: both pans at 80 degrees, a marker at the computed fixation point."""
    return Station(
        "paper_marker",
        "The paper's hardware: both pans at 80 degrees, a marker placed at the computed fixation point",
        "marker",
        None,
        mode="left_held",
        start_vergence_deg=20.0,
    )


def cube_with_distractor() -> Station:
    """Return the detector's station: the goal is the class cube, and a look-alike is nearer than the cube."""
    return Station(
        "cube_distractor",
        "0.65 m, given by its class; a puzzle of 4 by 4 cells is nearer to the head and to the gaze",
        "cube",
        _at(0.65, 8.0, 3.0),
        by_class=True,
        distractor_m=_at(0.42, -5.0, -1.0),
    )


def stations(baseline_m: float, short: bool = False) -> list[Station]:
    """Return the demo's stations in order; the short demo has the paper's first, one more and the moving one."""
    free = [
        Station("cube_near_left", "0.4 m, 10 degrees left", "cube", _at(0.4, 10.0, 0.0)),
        Station("cube_right_up", "0.7 m, 20 degrees right, 10 up", "cube", _at(0.7, -20.0, 10.0)),
        Station("cube_left_down", "1.2 m, 18 degrees left, 6 down", "cube", _at(1.2, 18.0, -6.0)),
        Station("cube_far_up", "1.7 m, 8 degrees right, 8 up", "cube", _at(1.7, -8.0, 8.0)),
    ]
    moving = Station(
        "cube_moving",
        "0.6 m, oscillating across the line of sight",
        "cube",
        _at(0.6, 0.0, 0.0),
        motion={"motion.kind": "sinusoid", "motion.y_m": 0.06, "motion.frequency_hz": 0.12},
        hold_s=7.0,
    )
    if short:
        return [cube_held(baseline_m), free[1], moving]
    return [cube_held(baseline_m), marker_80_80(), *free, cube_with_distractor(), moving]
