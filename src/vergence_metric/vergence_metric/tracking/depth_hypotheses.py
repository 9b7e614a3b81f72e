"""The distances that a target may have: every pair's candidates are evidence, and no single pair decides.

A distance is kept as the target's parallax, the angle between both eyes' rays to it, which does not depend on where the
eyes look. Joint angles of hobby servos shift it by up to a degree when the eyes turn, all distances alike: a shaft that
turns back through its gears' play does not turn the eye. So each pair's candidates are compared with the hypotheses
moved by one common shift, the likeliest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_FORGOTTEN = 0.02  # weight below which a hypothesis is dropped
_MOST = 8
_LEAD = 2.0  # times the second weight
_PLAY_RAD = 0.02  # that servos may have in all
_SIGMAS, _SAME = 4.0, 1 / 3  # in the largest shift: its standard deviations, and how near a candidate must be


@dataclass(eq=False)
class Hypothesis:
    """A parallax [rad], the share of recent pairs that speak for it, 0 to 1, and the parallax at which it began."""

    parallax_rad: float
    weight: float
    first_rad: float


class DepthHypotheses:
    """Fading means of the probabilities that the pairs give to each parallax.

    Args:
        memory: share of the old weights that a pair leaves.
        apart_rad: the largest shift of all parallaxes that the joints' reports do not explain; those that differ by
            less than a third of it are the same.
        share: of the recent pairs that must speak for the likeliest for it to be certain.
    """

    def __init__(self, memory: float, apart_rad: float, share: float) -> None:
        self._memory, self._apart_rad, self._share = memory, apart_rad, share
        self._pairs, self._vergence_rad = 0, 0.0
        self.ranked: list[Hypothesis] = []
        """All hypotheses, the likeliest first."""

    @property
    def best(self) -> Hypothesis | None:
        """The likeliest hypothesis, None before the first candidate."""
        return self.ranked[0] if self.ranked else None

    @property
    def certain(self) -> bool:
        """True if enough of the recent pairs speak for the likeliest, and clearly more than for any other."""
        weights = [one.weight for one in self.ranked[:2]] + [0.0, 0.0]
        return weights[0] >= max(self._share, _LEAD * weights[1])

    @property
    def doubt(self) -> str:
        """Why no distance is certain."""
        if len(self.ranked) > 1:
            return "the target may be at one of several distances"
        return "the target's distance is not certain"

    def update(self, candidates: Sequence[tuple[float, float]], vergence_rad: float) -> Hypothesis | None:
        """Add the candidates of a pair, as (parallax [rad], probability), the answer first; returns its hypothesis.

        `vergence_rad` is what the joints report of the eyes in the pair.
        """
        self._pairs += 1
        new = max(1.0 - self._memory, 1.0 / self._pairs)
        shift = self._shift(candidates, vergence_rad)
        for one in self.ranked:
            one.weight *= 1.0 - new
            one.parallax_rad += shift
        known = [(one, self._seen_as(one, candidates)) for one in self.ranked]
        self.ranked = [one for one, place in known if place is None]
        answered = None
        for i, (parallax_rad, probability) in enumerate(candidates):
            # Those that a pair does not tell apart are one: the likeliest is kept.
            mine = [one for one, place in known if place == i] or [Hypothesis(parallax_rad, 0.0, parallax_rad)]
            one = max(mine, key=lambda one: one.weight)
            one.parallax_rad, one.weight = parallax_rad, one.weight + new * probability
            self.ranked.append(one)
            answered = answered or one
        self.ranked.sort(key=lambda one: -one.weight)
        self.ranked = [one for one in self.ranked[:_MOST] if one.weight >= _FORGOTTEN]
        return answered

    def _seen_as(self, one: Hypothesis, candidates: Sequence[tuple[float, float]]) -> int | None:
        """Return which of a pair's candidates is a hypothesis, None if none is."""
        off = [abs(parallax_rad - one.parallax_rad) for parallax_rad, _ in candidates]
        return off.index(min(off)) if off and min(off) <= _SAME * self._apart_rad else None

    def _shift(self, candidates: Sequence[tuple[float, float]], vergence_rad: float) -> float:
        """Return the likeliest shift of all parallaxes in this pair [rad], by what the joints report.

        All that they have reported since the likeliest hypothesis was last seen counts: nothing has explained it yet.
        """
        if not candidates:
            return 0.0
        if not self.ranked:
            self._vergence_rad = vergence_rad
            return 0.0
        turned_rad = max(-_PLAY_RAD, min(vergence_rad - self._vergence_rad, _PLAY_RAD))
        seen, probabilities = np.array(candidates).T
        known, weights = np.array([(one.parallax_rad, one.weight) for one in self.ranked]).T
        shifts = (seen[:, None] - known).ravel()
        # The eyes have turned by something between nothing, while play is taken up, and what is reported.
        explained = shifts.clip(min(turned_rad, 0.0), max(turned_rad, 0.0))
        off = np.abs(shifts - explained) / self._apart_rad
        same = np.abs(known + shifts[:, None, None] - seen[:, None]) <= _SAME * self._apart_rad
        agreeing = (same * weights).max(axis=2) @ probabilities
        likely = agreeing * np.exp(-0.5 * ((_SIGMAS * off) ** 2 + (explained / self._apart_rad) ** 2))
        best = int(likely.argmax())
        if off[best] > 1.0:
            return 0.0
        if same[best, :, 0].any():
            self._vergence_rad = vergence_rad  # from here on: the likeliest was seen
        return float(shifts[best])
