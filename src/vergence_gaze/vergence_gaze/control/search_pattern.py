"""Where to look while no target is in view: overlapping fields of view over all that is in reach, or anywhere."""

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_OVERLAP = 0.75


class Pattern(Protocol):
    """Places to look at, one after the other."""

    def next_place(self, version_rad: float, tilt_rad: float) -> tuple[float, float]:
        """Return the next place (version, tilt) [rad] from the present one; tilt is NaN where it is not to move."""
        ...


class SearchPattern:
    """Visits (version, tilt) places, the nearest to where the target was last first, and then each in turn again."""

    def __init__(self, rig: Rig, tilt_enabled: bool, vergence_rad: float) -> None:
        camera = rig.left_camera
        width_rad = 2.0 * math.atan(0.5 * camera.width_px / camera.fx_px) * _OVERLAP
        height_rad = 2.0 * math.atan(0.5 * camera.height_px / camera.fy_px) * _OVERLAP
        versions = _places(*_versions(rig, vergence_rad), width_rad)
        tilts = _places(rig.tilt.lower_rad, rig.tilt.upper_rad, height_rad) if tilt_enabled else [math.nan]
        self._places = [(version, tilt_rad) for tilt_rad in tilts for version in versions]
        self._unvisited = list(self._places)

    def next_place(self, version_rad: float, tilt_rad: float) -> tuple[float, float]:
        """Return the nearest place not yet visited; see Pattern."""
        if not self._unvisited:
            self._unvisited = list(self._places)

        def distance(place: tuple[float, float]) -> float:
            away_tilt = 0.0 if math.isnan(place[1]) else place[1] - tilt_rad
            return max(abs(place[0] - version_rad), 2.0 * abs(away_tilt))

        nearest = min(self._unvisited, key=distance)
        self._unvisited.remove(nearest)
        return nearest


class RandomPattern:
    """Places anywhere in reach, at least `_LEAST_RAD` from the one before."""

    _LEAST_RAD = math.radians(8.0)

    def __init__(self, rig: Rig, tilt_enabled: bool, vergence_rad: float, random: np.random.Generator) -> None:
        self._versions, self._random = _versions(rig, vergence_rad), random
        self._tilts = (rig.tilt.lower_rad, rig.tilt.upper_rad) if tilt_enabled else None

    def next_place(self, version_rad: float, tilt_rad: float) -> tuple[float, float]:
        """Return any place; see Pattern."""
        for _ in range(20):
            version = float(self._random.uniform(*self._versions))
            if abs(version - version_rad) >= self._LEAST_RAD:
                break
        return version, math.nan if self._tilts is None else float(self._random.uniform(*self._tilts))


class Searcher:
    """Goes through a pattern: travels to a place, rests there for an image, goes on."""

    def __init__(self, make_pattern: Callable[[], Pattern], vergence_rad: float, dwell_s: float) -> None:
        self._make = make_pattern
        self._half_vergence_rad = 0.5 * vergence_rad
        self._dwell_s = dwell_s
        self.stop()

    def stop(self) -> None:
        """End the search; the next starts with all places unvisited."""
        self._pattern: Pattern | None = None
        self._until_s = -math.inf
        self._place = (math.nan, math.nan)

    def next_pose(self, now_s: float, shaft_rad: Array, speed_rad_s: Array) -> Array:
        """Return the joint angles (3,) to look at next, given the present ones (3,) and the joints' speeds (3,)."""
        if self._pattern is None:
            self._pattern = self._make()
        if now_s > self._until_s:
            version, tilt = 0.5 * float(shaft_rad[0] + shaft_rad[1]), float(shaft_rad[2])
            self._place = self._pattern.next_place(version, tilt)
            away = (abs(self._place[0] - version), abs(np.nan_to_num(self._place[1] - tilt)))
            travel_s = max(away[0] / float(speed_rad_s[:2].min()), away[1] / float(speed_rad_s[2]))
            self._until_s = now_s + travel_s + self._dwell_s
        version, tilt = self._place
        return np.array([version - self._half_vergence_rad, version + self._half_vergence_rad, tilt])


def _versions(rig: Rig, vergence_rad: float) -> tuple[float, float]:
    """Return the least and the largest version [rad] at which both eyes can converge by `vergence_rad`."""
    lowest = max(rig.pan_left.lower_rad, rig.pan_right.lower_rad) + 0.5 * vergence_rad
    highest = min(rig.pan_left.upper_rad, rig.pan_right.upper_rad) - 0.5 * vergence_rad
    return lowest, highest


def _places(lowest: float, highest: float, field_rad: float) -> list[float]:
    """Centres of fields of view that together cover from half a field's edge below to above the limits."""
    count = max(1, math.ceil((highest - lowest) / field_rad))
    if count == 1:
        return [0.5 * (lowest + highest)]
    margin = 0.5 * field_rad
    return [float(place) for place in np.linspace(lowest + margin, highest - margin, count)]
