"""Whether a track's depth is plausible: objects do not jump in depth, trackers do."""

import math
from collections import deque

from vergence_gaze.estimation.distractor_gate import SAME_DEPTH_RAD
from vergence_gaze.estimation.target_filter import TargetEstimate

_LONG_S = 0.8
_CONFIRMED_S = 0.1
_SAME_PAIR_S = 0.012
_GATE_SIGMA = 2.0
_TOLERANCE_RAD = 0.01


class DepthMonitor:
    """Detects when a track's vergence leaves the target's estimate, and for how long it stays there."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all measurements."""
        self._off_since_s = math.nan
        self._fovea: deque[tuple[float, float]] = deque(maxlen=30)

    @property
    def track_inconsistent(self) -> bool:
        """True while the track's depth is off the target's estimate."""
        return math.isfinite(self._off_since_s)

    def update_fovea(self, stamp_s: float, vergence_rad: float) -> None:
        """Add the vergence of what lies at the fovea."""
        self._fovea.append((stamp_s, vergence_rad))

    def is_depth_jump(
        self, stamp_s: float, vergence_rad: float, own_depth_rad: float, estimate: TargetEstimate
    ) -> bool:
        """Return whether a track's depth has jumped and is not accepted yet.

        A target that moved a moment ago may pass in front of something; of one at rest the fovea may confirm it.
        """
        gate_rad = _GATE_SIGMA * float(estimate.sigmas_rad[1])
        if abs(vergence_rad - estimate.vergence_rad) <= _TOLERANCE_RAD + own_depth_rad + gate_rad:
            self._off_since_s = math.nan
            return False
        if math.isnan(self._off_since_s):
            self._off_since_s = stamp_s
        confirmed = not estimate.moving and self._fovea_agrees(vergence_rad, own_depth_rad)
        return stamp_s - self._off_since_s < (_CONFIRMED_S if confirmed else _LONG_S)

    def _fovea_agrees(self, vergence_rad: float, own_depth_rad: float) -> bool:
        """Return whether all that the fovea measured since then is at the new depth."""
        since = [fovea_rad for stamp_s, fovea_rad in self._fovea if stamp_s > self._off_since_s - _SAME_PAIR_S]
        return bool(since) and all(abs(fovea - vergence_rad) < SAME_DEPTH_RAD + own_depth_rad for fovea in since)
