"""How far one pair shows that the eyes are on the target, by what was expected of it before it was seen."""

import math
from dataclasses import dataclass

_WRONG_SHARE = 0.05
"""How often a disparity is of something else, as estimators and detectors go in cluttered views."""
_WRONG_RANGE_RAD = 0.5
"""Over how much vergence such a one may lie: three hundred pixels of search."""


@dataclass(frozen=True)
class Belief:
    """An angle that is believed to be `mean_rad` +- `sigma_rad`."""

    mean_rad: float
    sigma_rad: float

    def beyond(self, limit_rad: float) -> float:
        """Return the probability that its absolute value exceeds a limit; 1 for what is not finite."""
        if not (math.isfinite(self.mean_rad) and math.isfinite(self.sigma_rad)):
            return 1.0
        scale = math.sqrt(2.0) * max(self.sigma_rad, 1e-9)
        above, below = limit_rad - self.mean_rad, limit_rad + self.mean_rad
        return min(0.5 * (math.erfc(above / scale) + math.erfc(below / scale)), 1.0)


def doubt(expected: Belief, measured: Belief, limit_rad: float) -> float:
    """Return the probability that an error is beyond a limit although a pair shows it within.

    The pair may be right and noisy, or of something else. That it is of something else is the less likely the better it
    agrees with what was expected, and does no harm as far as the expectation alone has the error within the limit.

    Args:
        expected: the error as it was foretold, from earlier images and the servos' model.
        measured: the error as the pair has it.
        limit_rad: the greatest error that is allowed.
    """
    spread = math.hypot(expected.sigma_rad, measured.sigma_rad)
    off = (measured.mean_rad - expected.mean_rad) / max(spread, 1e-9)
    if not (math.isfinite(spread) and math.isfinite(off)):
        return 1.0
    right = (1.0 - _WRONG_SHARE) * math.exp(-0.5 * min(off * off, 1e3)) / (math.sqrt(math.tau) * max(spread, 1e-9))
    wrong = _WRONG_SHARE / _WRONG_RANGE_RAD
    return min(wrong / (wrong + right) * expected.beyond(limit_rad) + measured.beyond(limit_rad), 1.0)
