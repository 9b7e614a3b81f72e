"""Confidence of a match: the share of matches with the same evidence that are right."""

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Evidence:
    """The evidence for a match.

    `correlation` is its windowed correlation, `independent` the number of independent samples in the window, `places`
    how many shifts were tried, `second` the best correlation of another candidate (0 if there is none) and
    `left_right_px` how far matching back misses. `ceiling` is the confidence of the coarser match it depends on.
    """

    correlation: float
    independent: float
    places: float
    second: float
    left_right_px: float
    ceiling: float = 1.0

    @classmethod
    def nothing(cls) -> "Evidence":
        """Return the evidence of no match at all."""
        return cls(0.0, 0.0, 1.0, 0.0, math.inf)

    @property
    def significance(self) -> float:
        """How far the correlation lies above chance, in standard deviations (Fisher's z), less the
        expected maximum.

        The best of n unrelated places lies about sqrt(2 ln n) deviations above none.
        """
        r = min(max(self.correlation, 0.0), 0.995)
        deviations = math.atanh(r) * math.sqrt(max(self.independent - 3.0, 0.0))
        return deviations - math.sqrt(2.0 * math.log(max(self.places, 1.0)))

    @property
    def beyond_chance(self) -> bool:
        """True if unrelated images would rarely correlate as well."""
        return self.significance > 1.5

    @property
    def confidence(self) -> float:
        """Share of matches with this evidence that lie within 2 px of the truth, from 0 to 1."""
        if self.correlation <= 0.0:
            return 0.0
        certain = 1.0 / (1.0 + math.exp(-2.0 * (self.significance - 1.5)))
        unique = min(max(2.0 * (1.0 - self.second / self.correlation), 0.0), 1.0)
        returns = 1.0 if self.left_right_px <= 2.0 else 0.1
        return min(certain * unique * returns, self.ceiling)

    def at_most(self, confidence: float) -> "Evidence":
        """Return the same evidence with a confidence of at most this."""
        return replace(self, ceiling=min(self.ceiling, confidence))
