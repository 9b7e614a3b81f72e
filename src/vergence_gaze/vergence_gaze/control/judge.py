"""When the eyes may be called verged: contrast, a small signed error and steady estimates, each with hysteresis."""

import math
from dataclasses import dataclass

from vergence_gaze.parameters import GazeParameters

_CONTRAST_AGE_S = 0.5
_SEEN_AGE_S = 1.0
_PAIR_MATCH_S = 0.08
_SAME_PAIR_S = 0.012
_LONG_ON_IT_S, _SEEN_LATELY_S = 0.4, 0.4


@dataclass(frozen=True)
class PairVerdict:
    """What one pair says: see `VergedJudge.see_pair`."""

    stamp_s: float
    error_rad: float
    aside_rad: float
    steady: bool
    resting: bool
    doubt: float
    placed: bool


class VergedJudge:
    """Takes one verdict per pair. `reason` says what is missing.

    A pair is judged again when more is told of it: its own contrast, or another sighting. One pair suffices where
    hardly a doubt is left and its own contrast agrees; otherwise `verged_pairs` in a row must say so.
    """

    def __init__(self, parameters: GazeParameters) -> None:
        self._p = parameters
        self._contrast_s = -math.inf
        self._good = self._bad = 0
        self._pair: PairVerdict | None = None
        self._last_pair_s = -math.inf
        self._good_before = self._bad_before = 0
        self._place_s, self._on_it_since_s = -math.inf, math.inf
        self.unresolved_rad = 0.0
        """Error that the servos cannot mend, beyond what the limits were made for: it keeps nobody from `verged`."""
        self.dead_band_rad = 0.0
        """The servos' largest dead band: where in it an axis stops, no command decides."""
        self.contrast = math.nan
        self.edge_verged = False
        self.verged = False
        self.since_s = math.nan
        self.reason = "nothing seen yet"

    def restart(self, reason: str = "new target") -> None:
        """Not verged until shown again."""
        self.verged = False
        self._good = self._bad = self._good_before = self._bad_before = 0
        self._pair = None
        self._on_it_since_s = math.inf
        self.since_s = math.nan
        self.reason = reason

    @property
    def enter_rad(self) -> float:
        """The largest vergence error at which eyes become verged."""
        return min(self._p.verged_enter_rad + self.unresolved_rad, self._p.verged_leave_rad)

    @property
    def aside_enter_rad(self) -> float:
        """The largest error of a gaze direction at which eyes become verged."""
        return max(self.enter_rad, min(self.dead_band_rad, self._p.verged_leave_rad))

    def see_contrast(self, stamp_s: float, contrast: float, edge_verged: bool, now_s: float) -> None:
        """Take the edge metric's judgement of a pair."""
        if not (math.isfinite(stamp_s) and stamp_s >= self._contrast_s):
            return
        self._contrast_s, self.contrast, self.edge_verged = stamp_s, contrast, edge_verged
        pair = self._pair
        if pair is not None and not self.verged and self._is_own_contrast(pair):
            self._enter(pair, now_s)

    def see_place(self, stamp_s: float, error_rad: float, aside_rad: float) -> None:
        """Take where the target itself was seen in a pair, however late that is told; see `see_pair`."""
        if not stamp_s > self._place_s:
            return
        self._place_s = stamp_s
        on_it = abs(error_rad) <= self.enter_rad and abs(aside_rad) <= self.aside_enter_rad
        self._on_it_since_s = min(self._on_it_since_s, stamp_s) if on_it else math.inf

    def has_been_on_it(self, now_s: float) -> bool:
        """Tell whether the target itself was on the axes in every pair for a while, up to now."""
        lately = now_s - self._place_s < _SEEN_LATELY_S
        return lately and self._place_s - self._on_it_since_s >= _LONG_ON_IT_S

    def exposure_for(self, stamp_s: float, now_s: float) -> float:
        """Return when a target that no image gave is to be judged: at the newest image that counts, points are younger.

        However late images are, each of them then gives one verdict.
        """
        counts = self._p.contrast != "ignored" and now_s - self._contrast_s <= _SEEN_AGE_S
        return min(stamp_s, self._contrast_s) if counts else stamp_s

    def see_pair(
        self,
        stamp_s: float,
        now_s: float,
        error_rad: float,
        steady: bool,
        resting: bool,
        doubt: float = 1.0,
        aside_rad: float = 0.0,
        placed: bool = True,
    ) -> bool:
        """Judge one pair in which the target was measured; returns `verged`.

        Args:
            stamp_s: the pair's stamp; every pair counts once, by the last that is told of it until it is verged, and
                by the worst from then on: the fovea tells nothing of a direction.
            now_s: the present.
            error_rad: the vergence error in that pair.
            steady: whether the estimate is certain enough.
            resting: whether the eyes were still enough in that pair to see.
            doubt: the probability that the eyes are off after all, for all that was known before and is seen now.
            aside_rad: the largest error of a gaze direction in that pair.
            placed: whether the target itself was seen lately, not only something at its depth.
        """
        if not stamp_s >= self._last_pair_s or (stamp_s == self._last_pair_s and self._pair is None):
            return self.verged
        if stamp_s > self._last_pair_s:
            self._last_pair_s, self._good_before, self._bad_before = stamp_s, self._good, self._bad
        elif self.verged and self._bad > self._bad_before:
            return self.verged  # it is bad already
        self._pair = PairVerdict(stamp_s, error_rad, aside_rad, steady, resting, doubt, placed)
        if self.verged:
            self._stay(self._pair, now_s)
        else:
            self._enter(self._pair, now_s)
        return self.verged

    def _enter(self, pair: PairVerdict, now_s: float) -> None:
        good = self._within(pair, now_s, (self.enter_rad, self.aside_enter_rad), self._p.contrast_enter)
        if good and not (pair.steady and pair.resting):
            good, self.reason = False, "estimate not steady yet"
        self._good = self._good_before + 1 if good else 0
        certain = pair.doubt <= self._p.verged_doubt and (
            self._is_own_contrast(pair) or not self._heeds_contrast(now_s)
        )
        if good and (certain or self._good >= self._p.verged_pairs):
            self.verged, self.since_s, self._bad, self._bad_before = True, now_s, 0, 0

    def _stay(self, pair: PairVerdict, now_s: float) -> None:
        good = self._within(pair, now_s, (self._p.verged_leave_rad,) * 2, self._p.contrast_leave)
        self._bad = 0 if good else self._bad_before + 1
        if self._bad >= self._p.unverged_pairs:
            self.verged, self.since_s, self._good = False, math.nan, 0

    def _within(self, pair: PairVerdict, now_s: float, limits_rad: tuple[float, float], contrast_limit: float) -> bool:
        if not pair.placed:
            self.reason = "something at the target's depth lies at the fovea, but the target was not seen for long"
            return False
        for error_rad, limit_rad in zip((pair.error_rad, pair.aside_rad), limits_rad, strict=True):
            if not abs(error_rad) <= limit_rad:
                self.reason = f"error {math.degrees(abs(error_rad)):.2f} deg"
                return False
        against = self._contrast_against(pair.stamp_s, now_s, contrast_limit)
        self.reason = against or "contrast, signed error and steadiness agree"
        return not against

    def _is_own_contrast(self, pair: PairVerdict) -> bool:
        return abs(pair.stamp_s - self._contrast_s) <= _SAME_PAIR_S

    def _heeds_contrast(self, now_s: float) -> bool:
        if self._p.contrast == "when_seen":
            return now_s - self._contrast_s <= _SEEN_AGE_S
        return self._p.contrast == "required"

    def _contrast_against(self, stamp_s: float, now_s: float, limit: float) -> str:
        """Return what the contrast has against `verged`; empty if nothing."""
        if not self._heeds_contrast(now_s):
            return ""
        if now_s - self._contrast_s > _SEEN_AGE_S:
            return "no edge contrast arrives"
        if stamp_s - self._contrast_s > _PAIR_MATCH_S + (_CONTRAST_AGE_S if self.verged else 0.0):
            return "the edge contrast is older than the disparity"
        if self.edge_verged or self.contrast <= limit:
            return ""
        return f"contrast {self.contrast:.2f} above {limit:.2f}"
