"""The distances that a target may have: every pair's candidates are evidence, and no single pair decides.

A distance is kept as the target's parallax, the angle between both eyes' rays to it, which does not depend on where the
eyes look. Joint angles of hobby servos shift it by up to a degree when the eyes turn: candidates are assigned to the
nearest hypothesis within that, and the hypothesis moves along.
"""

from collections.abc import Sequence
from dataclasses import dataclass

_FORGOTTEN = 0.02  # weight below which a hypothesis is dropped
_MOST = 8
_LEAD = 2.0  # times the second weight


@dataclass
class Hypothesis:
    """A parallax [rad], the share of recent pairs that speak for it, 0 to 1, and the parallax at which it began."""

    parallax_rad: float
    weight: float
    first_rad: float


class DepthHypotheses:
    """Fading means of the probabilities that the pairs give to each parallax.

    Args:
        memory: share of the old weights that a pair leaves.
        apart_rad: parallaxes that differ by less may be the same.
        share: of the recent pairs that must speak for the likeliest for it to be certain.
    """

    def __init__(self, memory: float, apart_rad: float, share: float) -> None:
        self._memory, self._apart_rad, self._share = memory, apart_rad, share
        self._pairs = 0
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

    def update(self, candidates: Sequence[tuple[float, float]]) -> Hypothesis | None:
        """Add the candidates of a pair, as (parallax [rad], probability), the answer first; returns its hypothesis."""
        self._pairs += 1
        new = max(1.0 - self._memory, 1.0 / self._pairs)
        for one in self.ranked:
            one.weight *= 1.0 - new
        free, answered = list(self.ranked), None
        for i, (parallax_rad, probability) in enumerate(candidates):
            mine = min(free, key=lambda one: abs(one.parallax_rad - parallax_rad), default=None)
            if mine is None or abs(mine.parallax_rad - parallax_rad) > self._apart_rad:
                mine = Hypothesis(parallax_rad, 0.0, parallax_rad)
                self.ranked.append(mine)
            else:
                free.remove(mine)
            mine.parallax_rad, mine.weight = parallax_rad, mine.weight + new * probability
            answered = mine if i == 0 else answered
        self.ranked.sort(key=lambda one: -one.weight)
        self.ranked = [one for one in self.ranked[:_MOST] if one.weight >= _FORGOTTEN]
        return answered
