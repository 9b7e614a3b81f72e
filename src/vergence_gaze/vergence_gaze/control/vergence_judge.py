"""When the eyes are verged: low contrast, a small signed error and a certain estimate, each with hysteresis."""

import math
from dataclasses import dataclass

from vergence_gaze.estimation.observations import SAME_PAIR_S
from vergence_gaze.verged_parameters import VergedParameters
from vergence_rig.verged import objection


@dataclass(frozen=True)
class PairEvidence:
    """The evidence of one pair: see `VergenceJudge.update_pair`."""

    stamp_s: float
    vergence_error_rad: float
    direction_error_rad: float
    steady: bool
    resting: bool
    error_probability: float
    objection: str


class VergenceJudge:
    """Decides `verged` pair by pair; `reason` says what is missing.

    A pair is judged again when more of it arrives: its own contrast, or another measurement. One pair suffices where an
    error is improbable enough and its own contrast agrees; otherwise it takes `verged.enter_pairs` in a row.
    """

    def __init__(self, parameters: VergedParameters) -> None:
        self._p = parameters
        self._contrast_s = -math.inf
        self._good = self._bad = 0
        self._pair: PairEvidence | None = None
        self._last_pair_s = -math.inf
        self._good_before = self._bad_before = 0
        self._target_s, self._on_target_since_s = -math.inf, math.inf
        self.unresolved_rad = 0.0
        """Error that the servos cannot correct, beyond what the limits were made for; it is added to `enter_rad`."""
        self.target_moves = False
        """Whether the eyes follow a moving target: then what is seen of it lags behind."""
        self.dead_band_rad = 0.0
        """The servos' largest dead band: no command decides where in it an axis stops."""
        self.contrast = math.nan
        self.verged = False
        self.since_s = math.nan
        self.reason = "the target was not measured yet"

    def restart(self, reason: str = "new target") -> None:
        """Clear `verged` until it is shown again."""
        self.verged = False
        self._good = self._bad = self._good_before = self._bad_before = 0
        self._pair = None
        self._on_target_since_s = math.inf
        self.since_s = math.nan
        self.reason = reason

    @property
    def enter_rad(self) -> float:
        """The largest vergence error at which eyes become verged."""
        limit_rad = self._p.direction_rad if self.target_moves else self._p.enter_rad
        return min(limit_rad + self.unresolved_rad, self._p.leave_rad)

    @property
    def direction_enter_rad(self) -> float:
        """The largest error of a gaze direction at which eyes become verged."""
        return min(max(self._p.direction_rad, self.dead_band_rad) + self.unresolved_rad, self._p.leave_rad)

    def update_contrast(self, stamp_s: float, contrast: float, now_s: float) -> None:
        """Add the edge contrast of a pair."""
        if not (math.isfinite(stamp_s) and stamp_s >= self._contrast_s):
            return
        self._contrast_s, self.contrast = stamp_s, contrast
        pair = self._pair
        if pair is not None and not self.verged and self._is_own_contrast(pair):
            self._enter(pair, now_s)

    def update_target(self, stamp_s: float, vergence_error_rad: float, direction_error_rad: float) -> None:
        """Add the errors to the identified target in a pair, however late they arrive; see `update_pair`."""
        if not stamp_s > self._target_s:
            return
        self._target_s = stamp_s
        on_target = abs(vergence_error_rad) <= self.enter_rad and abs(direction_error_rad) <= self.direction_enter_rad
        self._on_target_since_s = min(self._on_target_since_s, stamp_s) if on_target else math.inf

    def long_on_target(self, now_s: float) -> bool:
        """Return whether the identified target was on the axes in every pair for a while, up to now."""
        lately = now_s - self._target_s < self._p.followed_s
        return lately and self._target_s - self._on_target_since_s >= self._p.followed_s

    def exposure_for(self, stamp_s: float, now_s: float) -> float:
        """Return the time at which a streamed point is judged: that of the newest image that counts; points are newer.

        So each image gives one verdict, however late it is.
        """
        counts = self._p.contrast != "ignored" and now_s - self._contrast_s <= self._p.contrast_lost_s
        return min(stamp_s, self._contrast_s) if counts else stamp_s

    def update_pair(
        self,
        stamp_s: float,
        now_s: float,
        vergence_error_rad: float,
        steady: bool,
        resting: bool,
        error_probability: float = 1.0,
        direction_error_rad: float = 0.0,
        objection: str = "",
    ) -> bool:
        """Judge one pair in which the target was measured; returns `verged`.

        Args:
            stamp_s: the pair's stamp; every pair counts once, by its last measurement until `verged` is set, and by its
                worst from then on.
            now_s: the present.
            vergence_error_rad: the vergence error in that pair.
            steady: whether the estimate is certain enough.
            resting: whether the eyes were still enough in that pair.
            error_probability: of an error beyond the limit, given the prediction before the pair and the pair itself.
            direction_error_rad: the largest error of a gaze direction in that pair.
            objection: why what was measured may not be the target; "" if nothing speaks against it.
        """
        if not stamp_s >= self._last_pair_s or (stamp_s == self._last_pair_s and self._pair is None):
            return self.verged
        if stamp_s > self._last_pair_s:
            self._last_pair_s, self._good_before, self._bad_before = stamp_s, self._good, self._bad
        elif self.verged and self._bad > self._bad_before:
            return self.verged  # the pair is counted as bad already
        self._pair = PairEvidence(
            stamp_s, vergence_error_rad, direction_error_rad, steady, resting, error_probability, objection
        )
        if self.verged:
            self._stay(self._pair, now_s)
        else:
            self._enter(self._pair, now_s)
        return self.verged

    def _enter(self, pair: PairEvidence, now_s: float) -> None:
        good = self._within(pair, now_s, (self.enter_rad, self.direction_enter_rad))
        if good and not (pair.steady and pair.resting):
            good, self.reason = False, "the target's estimate is not certain yet, or the eyes move"
        self._good = self._good_before + 1 if good else 0
        certain = pair.error_probability <= self._p.single_pair_error_probability and (
            self._is_own_contrast(pair) or not self._uses_contrast(now_s)
        )
        if good and (certain or self._good >= self._p.enter_pairs):
            self.verged, self.since_s, self._bad, self._bad_before = True, now_s, 0, 0

    def _stay(self, pair: PairEvidence, now_s: float) -> None:
        good = self._within(pair, now_s, (self._p.leave_rad,) * 2)
        self._bad = 0 if good else self._bad_before + 1
        if self._bad >= self._p.leave_pairs:
            self.verged, self.since_s, self._good = False, math.nan, 0

    def _within(self, pair: PairEvidence, now_s: float, limits_rad: tuple[float, float]) -> bool:
        errors = [
            ("vergence", pair.vergence_error_rad, limits_rad[0]),
            ("direction", pair.direction_error_rad, limits_rad[1]),
        ]
        contrast, limit = self.contrast if self._uses_contrast(now_s) else math.nan, self._p.contrast_limit(self.verged)
        doubt = pair.objection or self._missing_contrast(pair.stamp_s, now_s) or objection(contrast, limit, errors)
        self.reason = doubt or "contrast, signed error and certainty of the estimate agree"
        return not doubt

    def _is_own_contrast(self, pair: PairEvidence) -> bool:
        return abs(pair.stamp_s - self._contrast_s) <= SAME_PAIR_S

    def _uses_contrast(self, now_s: float) -> bool:
        if self._p.contrast == "when_seen":
            return now_s - self._contrast_s <= self._p.contrast_lost_s
        return self._p.contrast == "required"

    def _missing_contrast(self, stamp_s: float, now_s: float) -> str:
        """Return why there is no contrast to judge a pair by; empty if there is, or if none is used."""
        if not self._uses_contrast(now_s):
            return ""
        if now_s - self._contrast_s > self._p.contrast_lost_s:
            return "no edge contrast arrives"
        if not self.verged and stamp_s - self._contrast_s > self._p.contrast_age_s:
            return "the newest edge contrast is older than the disparity"
        return ""
