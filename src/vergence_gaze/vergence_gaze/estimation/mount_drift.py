"""How far the cameras' mounts have moved since the head was identified: a bumped camera, from the visual encoder.

Within one rest of the eyes, servo play and a moved mount look alike. Over many rests the play differs, and the mount
does not: the median over the last rests is the mount's. It is robust against single wrong readings, and follows a bump
once more than half of the rests came after it.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Joints, Rig

Array = npt.NDArray[np.float64]

_RESTS = 15
_LEAST_RESTS = 7
_SIGNIFICANT = 3.0
_MEDIAN_ERROR = 1.2533 * 1.4826
"""Standard error of a median of n values, over their median absolute deviation divided by sqrt(n)."""
_LEAST_ERROR_RAD = math.radians(0.02)
MOST_CORRECTED_RAD = math.radians(2.0)
"""Largest change of the vergence that is corrected; more asks for `vergence identify`."""
MOST_TURNED_RAD = math.radians(1.0)
"""Largest roll and pitch between the eyes, beyond those of rig.yaml, that asks for nothing."""


@dataclass(frozen=True)
class MountReading:
    """How the eyes stand to one another, beyond what rig.yaml and the joints say [rad].

    `vergence_rad` is against the rig as corrected now; roll and pitch are of the right eye against the left one.
    """

    vergence_rad: float
    roll_rad: float
    pitch_rad: float


class MountDrift:
    """Slow offsets of the mounts, from one reading of every rest; immutable in between.

    `correction_rad` is added to the vergence of the joints: it changes only at the end of a rest, by a change that is
    certain, and within MOST_CORRECTED_RAD.
    """

    def __init__(self) -> None:
        self._rests: deque[tuple[float, float, float]] = deque(maxlen=_RESTS)
        self._newest: MountReading | None = None
        self._contradictory: deque[bool] = deque(maxlen=_RESTS)
        self._contradicts = False
        self.correction_rad = 0.0

    def update(self, reading: MountReading) -> None:
        """Keep the newest reading of this rest."""
        if all(math.isfinite(value) for value in (reading.vergence_rad, reading.roll_rad, reading.pitch_rad)):
            self._newest, self._contradicts = reading, False

    def on_contradiction(self) -> None:
        """The encoder's reading of this rest differs from the joints by more than play and mounts can."""
        self._newest, self._contradicts = None, True

    def on_pan_moved(self) -> bool:
        """End the rest; return whether `correction_rad` has changed."""
        newest, self._newest = self._newest, None
        if newest is None and not self._contradicts:
            return False
        self._contradictory.append(self._contradicts)
        self._contradicts = False
        if newest is None:
            return False
        self._rests.append((newest.vergence_rad + self.correction_rad, newest.roll_rad, newest.pitch_rad))
        if not self.known:
            return False
        vergence_rad, error_rad = float(self.offsets_rad[0]), float(self.errors_rad[0])
        if abs(vergence_rad - self.correction_rad) <= _SIGNIFICANT * error_rad:
            return False
        self.correction_rad = min(max(vergence_rad, -MOST_CORRECTED_RAD), MOST_CORRECTED_RAD)
        return True

    @property
    def known(self) -> bool:
        """True once enough rests were read."""
        return len(self._rests) >= _LEAST_RESTS

    @property
    def offsets_rad(self) -> Array:
        """Medians (3,) of vergence, roll and pitch beyond those of rig.yaml [rad]; NaN until `known`."""
        return np.median(self._rests, axis=0) if self.known else np.full(3, math.nan)

    @property
    def errors_rad(self) -> Array:
        """Standard errors (3,) of the offsets [rad]; NaN until `known`."""
        if not self.known:
            return np.full(3, math.nan)
        spread = np.median(np.abs(np.asarray(self._rests) - self.offsets_rad), axis=0)
        return np.asarray(np.maximum(_MEDIAN_ERROR * spread / math.sqrt(len(self._rests)), _LEAST_ERROR_RAD))

    @property
    def request(self) -> str:
        """Why the head should be identified again; empty if it need not be."""
        rests, contradictions = len(self._contradictory), sum(self._contradictory)
        if rests >= _LEAST_RESTS and 2 * contradictions > rests:
            return (
                f"the eyes' rotation contradicted the joints in {contradictions} of the last {rests} rests: "
                "was a camera moved? run `vergence identify`"
            )
        if not self.known:
            return ""
        limits = (MOST_CORRECTED_RAD, MOST_TURNED_RAD, MOST_TURNED_RAD)
        names = ("vergence", "roll between the eyes", "pitch between the eyes")
        for name, offset_rad, error_rad, limit_rad in zip(
            names, self.offsets_rad.tolist(), self.errors_rad.tolist(), limits, strict=True
        ):
            if abs(offset_rad) - _SIGNIFICANT * error_rad > limit_rad:
                return (
                    f"{name} must be within {math.degrees(limit_rad):.1f} degrees of rig.yaml's: got "
                    f"{math.degrees(offset_rad):+.2f} over the last {len(self._rests)} rests; was a camera moved? run "
                    "`vergence identify`"
                )
        return ""

    def corrected(self, rig: Rig) -> Rig:
        """Return a rig with the correction, half of it in each pan's zero: vergence changes, version does not."""
        half_rad = 0.5 * self.correction_rad
        left, right = rig.pan_left, rig.pan_right
        return replace(
            rig,
            joints=Joints(
                replace(left, zero_rad=left.zero_rad - half_rad),
                replace(right, zero_rad=right.zero_rad + half_rad),
                rig.tilt,
            ),
        )

    def summary(self) -> dict[str, object]:
        """Return the values for diagnostics, in degrees; empty until `known`."""
        if not self.known:
            return {}
        names = ("mount_vergence_deg", "mount_roll_deg", "mount_pitch_deg")
        offsets: dict[str, object] = {
            name: round(math.degrees(value), 3) for name, value in zip(names, self.offsets_rad.tolist(), strict=True)
        }
        return offsets | {"mount_vergence_corrected_deg": round(math.degrees(self.correction_rad), 3)}
