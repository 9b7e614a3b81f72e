"""Two measurements outside the gate: is the target elsewhere, and does it move?"""

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.kalman import Measurement

Array = npt.NDArray[np.float64]

RATE_SIGMA_RAD_S = 0.5
"""Standard deviation of an unknown target's speed."""
_ONE_PAIR_S = 0.01


def consistent(before: Measurement, after: Measurement) -> bool:
    """Return whether two measurements may be of one object."""
    bound = 5.0 * np.hypot(before.sigmas, after.sigmas)
    bound = bound + 2.0 * RATE_SIGMA_RAD_S * max(after.stamp_s - before.stamp_s, 0.0)
    return bool((np.abs(before.values - after.values) <= bound).all())


def continues_moving(before: Measurement, after: Measurement, bound: float) -> bool:
    """Return whether a target moved on from one measurement to the next, by their squared Mahalanobis distance.

    A target that has jumped stays there. Less than both eyes' directions, or one pair twice, shows no motion.
    """
    if len(after.values) < 3 or not after.stamp_s - before.stamp_s > _ONE_PAIR_S:
        return False
    spread = np.square(before.sigmas) + np.square(after.sigmas)
    return bool((np.square(before.values - after.values) / spread).sum() > bound)


def rates_between(before: Measurement, after: Measurement) -> tuple[Array, float]:
    """Return the rates (3,) between two places of a target that was expected elsewhere, and their variance."""
    prior = RATE_SIGMA_RAD_S**2
    duration_s = after.stamp_s - before.stamp_s
    if not duration_s > _ONE_PAIR_S:
        return np.zeros(3), prior
    rates = np.asarray(np.linalg.solve(after.coefficients, after.values - before.values) / duration_s, dtype=np.float64)
    noise = 2.0 * float(np.max(after.sigmas)) ** 2 / duration_s**2
    return rates * (prior / (prior + noise)), prior * noise / (prior + noise)
