"""The vergence that the visual encoder measures, relative to the shafts' estimate, while the eyes rest."""

import math

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_GATE = 3.0
_COMMON_SHARE = 0.9
"""Share of a reading's variance common to all readings of one rest: the same features through the same lenses."""
_MOUNT_TOLERANCE_RAD = 0.0175
_WORST_SIGMA_RAD = 0.1


def farthest_offset_rad(rig: Rig) -> float:
    """Return how far the true vergence can be from the shafts' estimated one: both servos' play, mounts and zeros."""
    servos = (rig.joints.pan_left.servo, rig.joints.pan_right.servo)
    return sum(2.0 * servo.uncertainty_rad for servo in servos) + _MOUNT_TOLERANCE_RAD + rig.zero_error_rad


class VergenceOffset:
    """The true vergence minus the shafts' estimated one, from the visual encoder's readings while the eyes rest.

    Every move of a pan makes it unknown again: the shaft then stops elsewhere in its play. A reading that is unlikely
    by the shafts' model waits for a second one that agrees with it: servos are worse than their data sheets, but one
    reading may be wrong. `rejection` says why the last reading was rejected; it is empty if it was accepted.
    """

    def __init__(self, shaft_variances: Array, farthest_rad: float = math.inf) -> None:
        self._prior = float(shaft_variances[0] + shaft_variances[1])
        self._farthest_rad = farthest_rad
        self.accepted = 0
        self.rejected = 0
        self.rejection = ""
        self.on_pan_moved(-math.inf)

    def on_pan_moved(self, stamp_s: float) -> None:
        """Reset the offset: a pan has moved at `stamp_s`."""
        self.offset_rad, self.variance = 0.0, self._prior
        self._rest_since_s = self._seen_s = stamp_s
        self._unlikely_rad = math.nan

    @property
    def known(self) -> bool:
        """True once a reading of this rest was accepted."""
        return self._seen_s > self._rest_since_s

    def update(self, stamp_s: float, difference_rad: float, sigma_rad: float) -> bool:
        """Update by a measured true vergence minus the shafts' at that stamp; returns False if it was rejected."""
        self.rejection = self._rejection_of(stamp_s, difference_rad, sigma_rad)
        if self.rejection:
            self.rejected += 1
        else:
            self.accepted += 1
            self._seen_s, self._unlikely_rad = stamp_s, math.nan
        return not self.rejection

    def _rejection_of(self, stamp_s: float, difference_rad: float, sigma_rad: float) -> str:
        if not (math.isfinite(difference_rad) and 0.0 < sigma_rad < _WORST_SIGMA_RAD):
            return "the reading has no usable standard deviation"
        if not stamp_s > self._seen_s:
            return "the reading predates the current fixation or one already used"
        if abs(difference_rad) > self._farthest_rad:
            return (
                f"the reading contradicts the joints by {math.degrees(abs(difference_rad)):.2f} degrees: "
                f"servo play and mounts explain at most {math.degrees(self._farthest_rad):.2f} degrees"
            )
        spread = self.variance + sigma_rad**2
        if (difference_rad - self.offset_rad) ** 2 <= _GATE**2 * spread:
            gain = self.variance / spread
            self.offset_rad += gain * (difference_rad - self.offset_rad)
            self.variance = max((1.0 - gain) * self.variance, min(_COMMON_SHARE * sigma_rad**2, self.variance))
            return ""
        before_rad, self._unlikely_rad = self._unlikely_rad, difference_rad
        if not abs(difference_rad - before_rad) <= _GATE * math.sqrt(2.0) * sigma_rad:
            off_deg = math.degrees(abs(difference_rad - self.offset_rad))
            return f"the reading is {off_deg:.2f} degrees off the estimate and came only once: a second must confirm it"
        self.offset_rad, self.variance = difference_rad, sigma_rad**2
        return ""
