"""Where the eyes were when an image was exposed.

Joint states of a hobby servo are commands passed through a speed limit, not measurements: the shaft follows them with
the play of its dead band and gears. The history therefore keeps, beside the reported angle, an estimate of the shaft's.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import JOINT_NAMES, Rig

Array = npt.NDArray[np.float64]

_KEEP_S = 2.0
_CLOCK_JUMP_S = 1.0
_STILL = np.zeros(3)


class JointHistory:
    """Reported and estimated joint angles, (3,) in the order of JOINT_NAMES [rad], over the last two seconds."""

    def __init__(self, rig: Rig) -> None:
        self._half_play = np.array(
            [0.5 * (s.servo.dead_band_rad + s.servo.backlash_rad) for _, s in rig.joints.items()]
        )
        self._stamps: list[float] = []
        self._reported: list[Array] = []
        self._shaft: list[Array] = []

    @property
    def known(self) -> bool:
        """True once every joint has been reported."""
        return bool(self._stamps)

    @property
    def newest_s(self) -> float:
        """Stamp of the newest report; NaN before the first."""
        return self._stamps[-1] if self._stamps else math.nan

    @property
    def reported_rad(self) -> Array:
        """The newest reported angles (3,)."""
        return self._reported[-1]

    @property
    def shaft_rad(self) -> Array:
        """The newest estimated shaft angles (3,)."""
        return self._shaft[-1]

    @property
    def half_play_rad(self) -> Array:
        """Half of each joint's dead band and backlash together (3,)."""
        return self._half_play

    def add(self, stamp_s: float, positions_rad: Mapping[str, float]) -> bool:
        """Take one report; False if it was refused (not finite, late, or a joint never heard of).

        A stamp that runs back by more than a second is a clock that was set: the history starts anew.
        """
        if not math.isfinite(stamp_s):
            return False
        if self._stamps and stamp_s < self._stamps[-1] - _CLOCK_JUMP_S:
            self.forget()
        if self._stamps and stamp_s <= self._stamps[-1]:
            return False
        angles = self._reported[-1].copy() if self._stamps else np.full(3, np.nan)
        for i, name in enumerate(JOINT_NAMES):
            value = positions_rad.get(name, math.nan)
            if math.isfinite(value) and abs(value) <= math.tau:
                angles[i] = value
        if not np.isfinite(angles).all():
            return False
        before = self._shaft[-1] if self._stamps else angles
        self._stamps.append(stamp_s)
        self._reported.append(angles)
        self._shaft.append(np.clip(before, angles - self._half_play, angles + self._half_play))
        surplus = bisect_left(self._stamps, stamp_s - _KEEP_S)
        if surplus > 64:
            del self._stamps[:surplus], self._reported[:surplus], self._shaft[:surplus]
        return True

    def forget(self) -> None:
        """Begin anew."""
        self._stamps, self._reported, self._shaft = [], [], []

    def covers(self, stamp_s: float) -> bool:
        """Tell whether the angles at `stamp_s` are known: not before the first report and not far after the last."""
        return bool(self._stamps) and self._stamps[0] <= stamp_s <= self._stamps[-1] + 0.2

    def shaft_at(self, stamp_s: float) -> Array:
        """Return the estimated shaft angles (3,) at `stamp_s`, interpolated; the ends are held."""
        return self._at(self._shaft, stamp_s)

    def reported_at(self, stamp_s: float) -> Array:
        """Return the reported angles (3,) at `stamp_s`, interpolated; the ends are held."""
        return self._at(self._reported, stamp_s)

    def speed_within(self, begin_s: float, end_s: float, along_rad_s: Array = _STILL) -> float:
        """Return the fastest joint's greatest speed between two times [rad/s]; 0 where nothing is known.

        With `along_rad_s` (3,) it is the speed beside these: how fast the eyes slip off a target that moves so.
        """
        first = max(bisect_right(self._stamps, begin_s) - 1, 0)
        last = min(bisect_left(self._stamps, end_s), len(self._stamps) - 1)
        fastest = 0.0
        for i in range(first, last):
            duration_s = self._stamps[i + 1] - self._stamps[i]
            speeds = (self._reported[i + 1] - self._reported[i]) / max(duration_s, 1e-4)
            fastest = max(fastest, float(np.abs(speeds - along_rad_s).max()))
        return fastest

    def _at(self, angles: Sequence[Array], stamp_s: float) -> Array:
        i = bisect_left(self._stamps, stamp_s)
        if i == 0:
            return angles[0]
        if i == len(self._stamps):
            return angles[-1]
        share = (stamp_s - self._stamps[i - 1]) / (self._stamps[i] - self._stamps[i - 1])
        return (1.0 - share) * angles[i - 1] + share * angles[i]
