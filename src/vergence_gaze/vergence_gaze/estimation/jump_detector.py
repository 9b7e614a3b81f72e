"""What two sightings that neither fitted the estimate say of a target: is it elsewhere, and does it move?"""

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.kalman import Measurement

Array = npt.NDArray[np.float64]

RATE_SIGMA_RAD_S = 0.5
"""How fast targets of which nothing is known move."""
_ONE_PAIR_S = 0.01


def agree(before: Measurement, after: Measurement) -> bool:
    """Tell whether two measurements may be of one thing."""
    allowed = 5.0 * np.hypot(before.sigmas, after.sigmas)
    allowed = allowed + 2.0 * RATE_SIGMA_RAD_S * max(after.stamp_s - before.stamp_s, 0.0)
    return bool((np.abs(before.values - after.values) <= allowed).all())


def goes_on(before: Measurement, after: Measurement, bound: float) -> bool:
    """Tell whether a target was on its way from one measurement to the next, by their squared distance in deviations.

    What has jumped stays where it is then. Less than both eyes' directions, or one pair twice, tells of no motion.
    """
    if len(after.values) < 3 or not after.stamp_s - before.stamp_s > _ONE_PAIR_S:
        return False
    spread = np.square(before.sigmas) + np.square(after.sigmas)
    return bool((np.square(before.values - after.values) / spread).sum() > bound)


def speed(before: Measurement, after: Measurement) -> tuple[Array, float]:
    """Return the rates (3,) between two places of a target that was thought to be elsewhere, and their variance."""
    prior = RATE_SIGMA_RAD_S**2
    duration_s = after.stamp_s - before.stamp_s
    if not duration_s > _ONE_PAIR_S:
        return np.zeros(3), prior
    rates = np.asarray(np.linalg.solve(after.coefficients, after.values - before.values) / duration_s, dtype=np.float64)
    noise = 2.0 * float(np.max(after.sigmas)) ** 2 / duration_s**2
    return rates * (prior / (prior + noise)), prior * noise / (prior + noise)
