"""The probability that the eyes are off the target although a pair shows them on it, given the prediction."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Gaussian:
    """A normally distributed angle."""

    mean_rad: float
    sigma_rad: float

    def probability_beyond(self, limit_rad: float) -> float:
        """Return the probability that its absolute value exceeds a limit; 1 for what is not finite."""
        if not (math.isfinite(self.mean_rad) and math.isfinite(self.sigma_rad)):
            return 1.0
        scale = math.sqrt(2.0) * max(self.sigma_rad, 1e-9)
        above, below = limit_rad - self.mean_rad, limit_rad + self.mean_rad
        return min(0.5 * (math.erfc(above / scale) + math.erfc(below / scale)), 1.0)


def probability_beyond_limit(
    predicted: Gaussian, measured: Gaussian, limit_rad: float, wrong_share: float, wrong_range_rad: float
) -> float:
    """Return the probability that an error is beyond a limit although a pair shows it within.

    The pair may be right and noisy, or of another object. The better it agrees with the prediction, the less likely it
    is of another object; and then the error is within the limit with the probability that the prediction gives.

    Args:
        predicted: the error predicted from earlier images and the servos' model.
        measured: the error measured in the pair.
        limit_rad: the largest error allowed.
        wrong_share: share of the pairs that are of another object.
        wrong_range_rad: range over which such a pair's error is uniform.
    """
    spread = math.hypot(predicted.sigma_rad, measured.sigma_rad)
    off = (measured.mean_rad - predicted.mean_rad) / max(spread, 1e-9)
    if not (math.isfinite(spread) and math.isfinite(off)):
        return 1.0
    right = (1.0 - wrong_share) * math.exp(-0.5 * min(off * off, 1e3)) / (math.sqrt(math.tau) * max(spread, 1e-9))
    wrong = wrong_share / wrong_range_rad
    return min(
        wrong / (wrong + right) * predicted.probability_beyond(limit_rad) + measured.probability_beyond(limit_rad), 1.0
    )
