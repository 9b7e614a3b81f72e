"""Joint angles of the recent past, interpolated at any stamp: an image is judged by the pose it was taken in."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from vergence_rig.geometry import EyeAngles
from vergence_rig.rig import JOINT_NAMES

Array = npt.NDArray[np.float64]
_LARGEST_COUNT = 4096


class JointSample(NamedTuple):
    """Joint angles (3,) [rad] in the order of JOINT_NAMES, and their stamp."""

    stamp: float
    angles_rad: Array


class JointHistory:
    """Keeps the joint states of the last seconds and interpolates between them by straight lines.

    One thread may add while others read. Stamps may be whole numbers: they are never turned into floats.

    Args:
        keep: how long a state is kept, in the unit of the stamps; the defaults are for nanoseconds.
        hold: for how long after the newest state its angles still stand for the present ones.
    """

    def __init__(self, keep: float = 2_000_000_000, hold: float = 200_000_000) -> None:
        self._keep, self._hold = keep, hold
        # Replaced as a whole at every addition, so that readers on other threads need no lock.
        self._kept: tuple[list[float], list[JointSample]] = ([], [])

    @property
    def known(self) -> bool:
        """True once a joint state was added."""
        return bool(self._kept[0])

    @property
    def newest(self) -> JointSample:
        """The newest state; raises IndexError before the first."""
        return self._kept[1][-1]

    def add(self, stamp: float, names: Sequence[str], positions_rad: Sequence[float]) -> bool:
        """Add a joint state; other joints than the three are ignored.

        Returns False, and adds nothing, if a joint is missing or not finite, or if the stamp is the newest one's. A
        stamp that runs back means that the clock was set: the history starts again with this state.
        """
        found = dict(zip(names, positions_rad, strict=False))
        return self.add_angles(stamp, np.array([found.get(name, math.nan) for name in JOINT_NAMES], np.float64))

    def add_angles(self, stamp: float, angles_rad: Array) -> bool:
        """Add the angles (3,) of all joints, in the order of JOINT_NAMES, which must not be changed; see `add`."""
        if not all(map(math.isfinite, angles_rad.tolist())):
            return False
        stamps, samples = self._kept
        if stamps and stamp <= stamps[-1]:
            if stamp == stamps[-1]:
                return False
            stamps, samples = [], []
        first = max(bisect_left(stamps, stamp - self._keep), len(stamps) + 1 - _LARGEST_COUNT)
        self._kept = ([*stamps[first:], stamp], [*samples[first:], JointSample(stamp, angles_rad)])
        return True

    def clear(self) -> None:
        """Remove all states."""
        self._kept = ([], [])

    def covers(self, stamp: float) -> bool:
        """Return whether the angles at `stamp` are known: not before the first state, nor `hold` after the last."""
        stamps, _ = self._kept
        return bool(stamps) and stamps[0] <= stamp <= stamps[-1] + self._hold

    def at(self, left_stamp: float, right_stamp: float) -> EyeAngles | None:
        """Return the left pan and the tilt at the left image's stamp and the right pan at the right one's.

        None for a stamp that is not covered; `gap` says why.
        """
        kept = self._kept
        stamps, _ = kept
        if not stamps or not all(stamps[0] <= stamp <= stamps[-1] + self._hold for stamp in (left_stamp, right_stamp)):
            return None
        left, right = (_at(*_bracket(kept, stamp), stamp) for stamp in (left_stamp, right_stamp))
        return EyeAngles(float(left[0]), float(right[1]), float(left[2]))

    def gap(self, stamp: float, units_per_s: float = 1e9) -> str:
        """Return why the angles at a stamp are not known, in units of which a second has `units_per_s`."""
        stamps, _ = self._kept
        if not stamps:
            return "the joint angles are not known: no usable joint_states have arrived"
        if stamp < stamps[0]:
            return f"joint_states begin {(stamps[0] - stamp) / units_per_s:.2f} s after the image"
        return f"no joint_states at the image's stamp: the newest is {(stamp - stamps[-1]) / units_per_s:.2f} s older"

    def samples_between(self, begin: float, end: float) -> list[tuple[float, EyeAngles]]:
        """Return the states after `begin`, up to the first that is not before `end`, with their stamps, in order."""
        stamps, samples = self._kept
        first, last = bisect_right(stamps, begin), bisect_left(stamps, end) + 1
        chosen = zip(stamps[first:last], samples[first:last], strict=True)
        return [(stamp, EyeAngles(*(float(angle) for angle in sample.angles_rad))) for stamp, sample in chosen]

    def spanning(self, begin: float, end: float) -> list[JointSample]:
        """Return the states between two stamps and the two that enclose them, as far as there are any."""
        stamps, samples = self._kept
        return samples[max(bisect_right(stamps, begin) - 1, 0) : bisect_left(stamps, end) + 1]

    def bracket(self, stamp: float) -> tuple[JointSample, JointSample]:
        """Return the last state before `stamp` and the first that is not; beyond an end, that end twice.

        Raises IndexError without any state.
        """
        return _bracket(self._kept, stamp)


def _bracket(kept: tuple[list[float], list[JointSample]], stamp: float) -> tuple[JointSample, JointSample]:
    stamps, samples = kept
    after = bisect_left(stamps, stamp)
    if after in (0, len(stamps)):
        end = samples[min(after, len(samples) - 1)]
        return end, end
    return samples[after - 1], samples[after]


def _at(before: JointSample, after: JointSample, stamp: float) -> Array:
    if before is after or after.stamp == stamp:
        return after.angles_rad
    return interpolated(before, after, stamp)


def interpolated(before: JointSample, after: JointSample, stamp: float) -> Array:
    """Return the angles (3,) on the straight line between two states at a stamp between theirs."""
    share = (stamp - before.stamp) / (after.stamp - before.stamp)
    return before.angles_rad + share * (after.angles_rad - before.angles_rad)
