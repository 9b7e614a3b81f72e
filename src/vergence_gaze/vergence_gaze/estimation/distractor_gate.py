"""Measurements far from the expected target: has it jumped, or are they of a distractor?

Objects keep their depth. A measurement elsewhere at the target's depth is the target; at another depth it has to
persist for a moment, longer if the target was moving, for then another object is likelier to pass. While the fovea
still shows the target where it was, or where a distractor was seen before, it has to persist for long.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.target_filter import TargetEstimate

Array = npt.NDArray[np.float64]

SAME_DEPTH_RAD = 0.006
_BESIDE_RAD = 0.02
_GATE_SIGMA = 4.0
_ONE_EYE_S = 0.12
_AT_REST_S = 0.06
_IN_MOTION_S = 0.35
_UNSEEN_S = 0.5
_REMEMBERED_S = 3.0
_UNKNOWN_EXTENT_RAD = 0.05


@dataclass(frozen=True)
class _Place:
    """An object at (left pan, right pan, tilt) (3,) [rad], NaN where unseen, of half width `half_rad`."""

    stamp_s: float
    seen_rad: Array
    half_rad: float
    depth_margin_rad: float

    @property
    def vergence_rad(self) -> float:
        return float(self.seen_rad[1] - self.seen_rad[0])

    def contains(self, joints_rad: Array) -> bool:
        """Return whether the object covers a direction (3,); NaN is not compared."""
        off = np.abs(self.seen_rad - joints_rad)
        return not (off > self.half_rad + _BESIDE_RAD).any()

    def as_deep_as(self, vergence_rad: float, margin_rad: float = 0.0) -> bool:
        """Return whether the object may be at this vergence."""
        return not abs(self.vergence_rad - vergence_rad) > self.depth_margin_rad + SAME_DEPTH_RAD + margin_rad


class DistractorGate:
    """Keeps what the fovea shows, since when the target is measured elsewhere, and which distractors were seen."""

    def __init__(self, persistence_s: float) -> None:
        self._persistence_s = persistence_s
        self.clear()

    def clear(self) -> None:
        """Forget all measurements."""
        self._fovea: deque[tuple[float, float, Array]] = deque(maxlen=30)
        self._beside: deque[_Place] = deque(maxlen=4)
        self._elsewhere: _Place | None = None
        self._since_s = math.nan
        self._expected_s = -math.inf

    def update_fovea(self, stamp_s: float, vergence_rad: float, axes_rad: Array) -> None:
        """Add the vergence of what lies at the fovea, with the eyes' axes (3,) then."""
        self._fovea.append((stamp_s, vergence_rad, axes_rad))

    def accepts(
        self, stamp_s: float, seen_rad: Array, extent_rad: float, own_depth_rad: float, estimate: TargetEstimate
    ) -> bool:
        """Return whether a measurement far from `estimate` is accepted as the target, which has jumped there."""
        half = 0.5 * extent_rad if math.isfinite(extent_rad) else _UNKNOWN_EXTENT_RAD
        place = _Place(stamp_s, seen_rad, min(max(half, 0.0), 0.5), own_depth_rad)
        if self._elsewhere is None or stamp_s - self._elsewhere.stamp_s > _UNSEEN_S:
            self._since_s = stamp_s
        self._elsewhere = place
        return stamp_s - self._since_s >= self._required_persistence_s(place, estimate)

    def on_target(self, stamp_s: float, estimate: TargetEstimate) -> None:
        """Record that the target was measured: what was measured elsewhere meanwhile is a distractor."""
        place, self._elsewhere = self._elsewhere, None
        self._expected_s = max(stamp_s, self._expected_s)
        if place is None or place.stamp_s == stamp_s:
            return
        if place.contains(estimate.joints_rad) and place.as_deep_as(estimate.vergence_rad):
            return
        self._beside = deque((other for other in self._beside if not _same(other, place)), maxlen=4)
        self._beside.append(place)

    def _required_persistence_s(self, place: _Place, estimate: TargetEstimate) -> float:
        known = any(place.stamp_s - other.stamp_s < _REMEMBERED_S and _same(other, place) for other in self._beside)
        if known or self._fovea_shows_target(estimate, place):
            return self._persistence_s
        if math.isnan(place.vergence_rad):
            return _ONE_EYE_S
        if place.as_deep_as(estimate.vergence_rad, _GATE_SIGMA * float(estimate.sigmas_rad[1])):
            return 0.0
        lately = place.stamp_s - self._expected_s < _UNSEEN_S
        return _IN_MOTION_S if estimate.moving and lately else _AT_REST_S

    def _fovea_shows_target(self, estimate: TargetEstimate, place: _Place) -> bool:
        """Return whether the fovea has shown the target since it is measured elsewhere."""
        for stamp_s, vergence_rad, axes_rad in self._fovea:
            if stamp_s < self._since_s - 1e-3 or abs(vergence_rad - estimate.vergence_rad) > SAME_DEPTH_RAD:
                continue
            if not (place.contains(axes_rad) and place.as_deep_as(vergence_rad)):
                return True
        return False


def _same(one: _Place, other: _Place) -> bool:
    return one.contains(other.seen_rad) and one.as_deep_as(other.vergence_rad)
