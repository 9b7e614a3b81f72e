"""Whether a tracked thing's depth may be believed: things do not jump in depth, trackers do."""

import math
from collections import deque

from vergence_gaze.estimation.distractor_gate import SAME_DEPTH_RAD
from vergence_gaze.estimation.target_filter import TargetEstimate

_LONG_S = 0.8
_CONFIRMED_S = 0.1
_SAME_PAIR_S = 0.012
_DOUBTS = 2.0
_TOLERANCE_RAD = 0.01


class DepthWatch:
    """Notices when a track's vergence leaves what is known of the target, and for how long it stays there."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Nothing has been seen."""
        self._off_since_s = math.nan
        self._fovea: deque[tuple[float, float]] = deque(maxlen=30)

    @property
    def doubts_the_track(self) -> bool:
        """True while the track's depth is off what is known of the target."""
        return math.isfinite(self._off_since_s)

    def see_fovea(self, stamp_s: float, vergence_rad: float) -> None:
        """Take the vergence of what lies at the fovea."""
        self._fovea.append((stamp_s, vergence_rad))

    def is_sudden(self, stamp_s: float, vergence_rad: float, own_depth_rad: float, estimate: TargetEstimate) -> bool:
        """Tell whether a track's depth is not to be believed yet.

        What moved a moment ago may pass before something; of what rested, the fovea may confirm the new depth.
        """
        doubt_rad = _DOUBTS * float(estimate.sigmas_rad[1])
        if abs(vergence_rad - estimate.vergence_rad) <= _TOLERANCE_RAD + own_depth_rad + doubt_rad:
            self._off_since_s = math.nan
            return False
        if math.isnan(self._off_since_s):
            self._off_since_s = stamp_s
        confirmed = not estimate.moving and self._fovea_agrees(vergence_rad, own_depth_rad)
        return stamp_s - self._off_since_s < (_CONFIRMED_S if confirmed else _LONG_S)

    def _fovea_agrees(self, vergence_rad: float, own_depth_rad: float) -> bool:
        """Tell whether all that the fovea saw since then is at the new depth."""
        since = [fovea_rad for stamp_s, fovea_rad in self._fovea if stamp_s > self._off_since_s - _SAME_PAIR_S]
        return bool(since) and all(abs(fovea - vergence_rad) < SAME_DEPTH_RAD + own_depth_rad for fovea in since)
