"""What the visual encoder tells of the shafts while the eyes rest."""

import math

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_GATE = 3.0
_COMMON_SHARE = 0.9
"""Of an encoder's variance, what its readings of one rest have in common: the same features through the same lenses."""
_MOUNT_TOLERANCE_RAD = 0.0175
_WORST_SIGMA_RAD = 0.1


def farthest_offset_rad(rig: Rig) -> float:
    """Return how far the true vergence can be from the shafts' estimated one: both servos' play, and mounts."""
    servos = (rig.joints.pan_left.servo, rig.joints.pan_right.servo)
    return sum(2.0 * servo.uncertainty_rad for servo in servos) + _MOUNT_TOLERANCE_RAD


class VergenceOffset:
    """How far the true vergence is from the shafts' estimated one, learnt from the visual encoder while the eyes rest.

    Every move of a pan makes it unknown again: the shaft then stops elsewhere in its play. A reading that the shafts'
    model finds unlikely waits for a second one that agrees with it: servos are worse than their data sheets, but one
    reading may be wrong. `refusal` says why the last reading was not believed, empty if it was.
    """

    def __init__(self, shaft_variances: Array, farthest_rad: float = math.inf) -> None:
        self._prior = float(shaft_variances[0] + shaft_variances[1])
        self._farthest_rad = farthest_rad
        self.believed = 0
        self.refused = 0
        self.refusal = ""
        self.moved(-math.inf)

    def moved(self, stamp_s: float) -> None:
        """A pan has moved, at `stamp_s`."""
        self.offset_rad, self.variance = 0.0, self._prior
        self._rest_since_s = self._seen_s = stamp_s
        self._unlikely_rad = math.nan

    @property
    def known(self) -> bool:
        """True once a reading of this rest was believed."""
        return self._seen_s > self._rest_since_s

    def see(self, stamp_s: float, difference_rad: float, sigma_rad: float) -> bool:
        """Take a measured true vergence minus the shafts' at that stamp; False if it is not believed."""
        self.refusal = self._take(stamp_s, difference_rad, sigma_rad)
        if self.refusal:
            self.refused += 1
        else:
            self.believed += 1
            self._seen_s, self._unlikely_rad = stamp_s, math.nan
        return not self.refusal

    def _take(self, stamp_s: float, difference_rad: float, sigma_rad: float) -> str:
        if not (math.isfinite(difference_rad) and 0.0 < sigma_rad < _WORST_SIGMA_RAD):
            return "it is not certain of anything"
        if not stamp_s > self._seen_s:
            return "it is of before the eyes came to rest, or of before one already seen"
        if abs(difference_rad) > self._farthest_rad:
            return (
                f"it contradicts the joints by {math.degrees(abs(difference_rad)):.2f} degrees: "
                f"servos and mounts allow {math.degrees(self._farthest_rad):.2f}"
            )
        spread = self.variance + sigma_rad**2
        if (difference_rad - self.offset_rad) ** 2 <= _GATE**2 * spread:
            gain = self.variance / spread
            self.offset_rad += gain * (difference_rad - self.offset_rad)
            self.variance = max((1.0 - gain) * self.variance, min(_COMMON_SHARE * sigma_rad**2, self.variance))
            return ""
        before_rad, self._unlikely_rad = self._unlikely_rad, difference_rad
        if not abs(difference_rad - before_rad) <= _GATE * math.sqrt(2.0) * sigma_rad:
            return f"it is {math.degrees(abs(difference_rad - self.offset_rad)):.2f} degrees off what was known: once"
        self.offset_rad, self.variance = difference_rad, sigma_rad**2
        return ""
