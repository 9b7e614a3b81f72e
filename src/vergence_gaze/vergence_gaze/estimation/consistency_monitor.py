"""Whether the estimators of the target's vergence agree: the fovea, the class-free tracker and the boxes.

The tracker and the boxes follow the target itself, the fovea measures whatever lies there: past a small target, the
background. Boxes identify the target, so where they are present they decide which of the others is right.
"""

import math
from collections import deque

_SAME_PAIR_S = 0.012
_FRESH_S = 0.5
_ENOUGH_PAIRS, _ENOUGH_PAIRS_MOVING, _MOST_PAIRS = 10, 24, 30
_SILENT_S = 0.3
_MEMORY = 0.7
_SMOOTHED = math.sqrt((1.0 - _MEMORY) / (1.0 + _MEMORY))
_GATE_SIGMA = 3.0
_ALWAYS_RAD = 0.003


class ConsistencyMonitor:
    """Compares vergences [rad] of the same pairs. `own_depth_rad` is what the object's own depth explains."""

    def __init__(self, disagreement_rad: float) -> None:
        self._disagreement_rad = disagreement_rad
        self.clear()

    def clear(self) -> None:
        """Forget all comparisons."""
        self._fovea: deque[tuple[float, float]] = deque(maxlen=30)
        self._track: deque[tuple[float, float]] = deque(maxlen=30)
        self._track_own_depth_rad = 0.0
        self._box_s, self._box_rad, self._box_sigma_rad, self._box_own_depth_rad = -math.inf, math.nan, 0.0, 0.0
        self._fovea_off, self._track_off = _Mean(), _Mean()
        self._differing = 0

    def disagreement(self, moving: bool) -> bool:
        """True while two estimators differ by more than the object's own depth explains, and no box decides.

        For a moving target it takes longer: it passes in front of others, and eyes that hold still would lose it.
        """
        return self._differing >= (_ENOUGH_PAIRS_MOVING if moving else _ENOUGH_PAIRS) and self._both_recent

    @property
    def differing(self) -> bool:
        """True if estimators have just differed, though not yet for long enough to be a disagreement."""
        return self._differing > 0 and self._both_recent

    @property
    def _both_recent(self) -> bool:
        """False once the fovea has no measurements any more while the tracker goes on."""
        return bool(self._track and self._fovea) and self._track[-1][0] - self._fovea[-1][0] < _SILENT_S

    def track_is_fresh(self, stamp_s: float, within_s: float) -> bool:
        """Return whether the tracker has measured the vergence lately."""
        return bool(self._track) and stamp_s - self._track[-1][0] < within_s

    def update_track(self, stamp_s: float, vergence_rad: float, own_depth_rad: float) -> None:
        """Add the tracker's vergence of a pair."""
        self._track.append((stamp_s, vergence_rad))
        self._track_own_depth_rad = own_depth_rad

    def drop_track(self) -> None:
        """Forget the tracker's measurements: its track is not the target."""
        self._track.clear()
        self._track_off, self._differing = _Mean(), 0

    def update_fovea(self, stamp_s: float, vergence_rad: float) -> None:
        """Add the fovea's vergence of a pair, and compare it with the tracker's of the same pair."""
        self._fovea.append((stamp_s, vergence_rad))
        if not self._track or abs(self._track[-1][0] - stamp_s) > 1e-6:
            if not self.track_is_fresh(stamp_s, _FRESH_S):
                self._differing = 0
            return
        if abs(vergence_rad - self._track[-1][1]) <= self._disagreement_rad + self._track_own_depth_rad:
            self._differing = max(self._differing - 2, 0)
        elif self._boxes_are_fresh(stamp_s) and self.fovea_inconsistent(stamp_s) != self.track_inconsistent(stamp_s):
            self._differing = 0
        else:
            self._differing = min(self._differing + 1, _MOST_PAIRS)

    def update_box(self, stamp_s: float, vergence_rad: float, sigma_rad: float, own_depth_rad: float) -> None:
        """Add the boxes' vergence of a pair; boxes are slow, so that the others' of that pair have arrived by then."""
        if not math.isfinite(vergence_rad):
            return
        if not self._boxes_are_fresh(stamp_s):
            self._fovea_off, self._track_off = _Mean(), _Mean()
        self._box_s, self._box_rad = max(stamp_s, self._box_s), vergence_rad
        self._box_sigma_rad, self._box_own_depth_rad = sigma_rad, own_depth_rad
        self._fovea_off.update(vergence_rad, self._fovea, stamp_s)
        self._track_off.update(vergence_rad, self._track, stamp_s)

    def fovea_inconsistent(self, stamp_s: float) -> bool:
        """Return whether, by the boxes, the object at the fovea is not the target."""
        return self._boxes_are_fresh(stamp_s) and self._fovea_off.beyond(self._box_own_depth_rad, self._box_sigma_rad)

    def track_inconsistent(self, stamp_s: float) -> bool:
        """Return whether, by the boxes, the tracker follows another object."""
        return self._boxes_are_fresh(stamp_s) and self._track_off.beyond(self._box_own_depth_rad, self._box_sigma_rad)

    def accepts_fovea(self, stamp_s: float, vergence_rad: float) -> bool:
        """Return whether this vergence at the fovea may be the target's, by the boxes so far."""
        if not self._boxes_are_fresh(stamp_s):
            return True
        if self._fovea_off.count >= 2:
            return not self._fovea_off.beyond(self._box_own_depth_rad, self._box_sigma_rad)
        bound_rad = self._box_own_depth_rad + _ALWAYS_RAD + _GATE_SIGMA * self._box_sigma_rad
        return abs(vergence_rad - self._box_rad) <= bound_rad

    @property
    def fovea_off_rad(self) -> float:
        """How far the fovea's vergence is from the boxes', on average; 0 while nothing could be compared."""
        return self._fovea_off.value_rad

    @property
    def track_off_rad(self) -> float:
        """As `fovea_off_rad`, of the tracker."""
        return self._track_off.value_rad

    def _boxes_are_fresh(self, stamp_s: float) -> bool:
        return stamp_s - self._box_s < _FRESH_S


class _Mean:
    """A fading mean of how far another estimator is from the boxes, over pairs that both have seen."""

    def __init__(self) -> None:
        self.count = 0
        self.value_rad = 0.0

    def update(self, box_rad: float, others: deque[tuple[float, float]], stamp_s: float) -> None:
        same = [value for other_s, value in others if abs(other_s - stamp_s) < _SAME_PAIR_S]
        if not same:
            return
        self.count += 1
        share = max(1.0 - _MEMORY, 1.0 / self.count)
        self.value_rad += share * (same[-1] - box_rad - self.value_rad)

    def beyond(self, own_depth_rad: float, sigma_rad: float) -> bool:
        if self.count < 2:
            return False
        spread_rad = sigma_rad * max(_SMOOTHED, 1.0 / math.sqrt(self.count))
        return abs(self.value_rad) > own_depth_rad + _ALWAYS_RAD + _GATE_SIGMA * spread_rad
