"""When the eyes may be called verged: contrast, a small signed error and steady estimates, each with hysteresis."""

import math

from vergence_servo.gaze.parameters import GazeParameters

_CONTRAST_AGE_S = 0.5
_SEEN_AGE_S = 1.0
_PAIR_MATCH_S = 0.08


class VergedJudge:
    """Takes one verdict per pair. `reason` says what is missing."""

    def __init__(self, parameters: GazeParameters) -> None:
        self._p = parameters
        self._contrast_s = -math.inf
        self._good = self._bad = 0
        self._last_pair_s = -math.inf
        self.unresolved_rad = 0.0
        """Error that the servos cannot mend, beyond what the limits were made for: it keeps nobody from `verged`."""
        self.contrast = math.nan
        self.edge_verged = False
        self.verged = False
        self.since_s = math.nan
        self.reason = "nothing seen yet"

    def restart(self, reason: str = "new target") -> None:
        """Not verged until shown again."""
        self.verged, self._good, self._bad = False, 0, 0
        self.since_s = math.nan
        self.reason = reason

    def see_contrast(self, stamp_s: float, contrast: float, edge_verged: bool) -> None:
        """Take the edge metric's judgement of a pair."""
        if math.isfinite(stamp_s) and stamp_s >= self._contrast_s:
            self._contrast_s, self.contrast, self.edge_verged = stamp_s, contrast, edge_verged

    def exposure_for(self, stamp_s: float, now_s: float) -> float:
        """Return when a target that no image gave is to be judged: at the newest image that counts, points are younger.

        However late images are, each of them then gives one verdict.
        """
        counts = self._p.contrast != "ignored" and now_s - self._contrast_s <= _SEEN_AGE_S
        return min(stamp_s, self._contrast_s) if counts else stamp_s

    def see_pair(self, stamp_s: float, now_s: float, error_rad: float, steady: bool, resting: bool) -> bool:
        """Judge one pair in which the target was measured; returns `verged`.

        Args:
            stamp_s: the pair's stamp; every pair counts once.
            now_s: the present.
            error_rad: the larger of the vergence error and of the gaze directions' errors in that pair.
            steady: whether the estimate is certain enough.
            resting: whether the eyes were still enough in that pair to see.
        """
        if not stamp_s > self._last_pair_s:
            return self.verged
        self._last_pair_s = stamp_s
        leave_rad = self._p.verged_leave_rad
        enter_rad = min(self._p.verged_enter_rad + self.unresolved_rad, leave_rad)
        limit = leave_rad if self.verged else enter_rad
        contrast_good, contrast_text = self._contrast_says(stamp_s, now_s)
        if not abs(error_rad) <= limit:
            good, self.reason = False, f"error {math.degrees(abs(error_rad)):.2f} deg"
        elif not contrast_good:
            good, self.reason = False, contrast_text
        elif not (self.verged or (steady and resting)):
            good, self.reason = False, "estimate not steady yet"
        else:
            good, self.reason = True, "contrast, signed error and steadiness agree"
        self._good, self._bad = (self._good + 1, 0) if good else (0, self._bad + 1)
        if not self.verged and self._good >= self._p.verged_pairs:
            self.verged, self.since_s = True, now_s
        elif self.verged and self._bad >= self._p.unverged_pairs:
            self.verged, self.since_s = False, math.nan
        return self.verged

    def _contrast_says(self, stamp_s: float, now_s: float) -> tuple[bool, str]:
        if self._p.contrast == "ignored":
            return True, ""
        if now_s - self._contrast_s > _SEEN_AGE_S:
            if self._p.contrast == "when_seen":
                return True, ""
            return False, "no edge contrast arrives"
        if stamp_s - self._contrast_s > _PAIR_MATCH_S + (_CONTRAST_AGE_S if self.verged else 0.0):
            return False, "the edge contrast is older than the disparity"
        limit = self._p.contrast_leave if self.verged else self._p.contrast_enter
        if self.edge_verged or self.contrast <= limit:
            return True, ""
        return False, f"contrast {self.contrast:.2f} above {limit:.2f}"
