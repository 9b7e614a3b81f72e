"""Joint angles of the recent past, so that an image is judged by the pose it was taken in."""

from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from vergence_rig.geometry import EyeAngles
from vergence_rig.rig import JOINT_NAMES

_PAN_LEFT, _PAN_RIGHT, _TILT = range(3)


class _Sample(NamedTuple):
    stamp_ns: int
    angles_rad: tuple[float, ...]


class JointHistory:
    """Keeps the last seconds of the three joints; other joints of a message are ignored.

    `extrapolate_ns` is how far beyond the newest sample an answer is still given: the newest one.
    """

    def __init__(self, keep_ns: int = 2_000_000_000, extrapolate_ns: int = 200_000_000) -> None:
        self._keep_ns = keep_ns
        self._extrapolate_ns = extrapolate_ns
        self._samples: deque[_Sample] = deque(maxlen=4096)

    @property
    def known(self) -> bool:
        """True once the joints have been told."""
        return bool(self._samples)

    def add(self, stamp_ns: int, names: Sequence[str], positions_rad: Sequence[float]) -> bool:
        """Take a joint state; False if it lacks a joint or a position. A stamp that goes back begins anew."""
        found = dict(zip(names, positions_rad, strict=False))
        if any(name not in found for name in JOINT_NAMES):
            return False
        if self._samples and stamp_ns < self._samples[-1].stamp_ns:
            self._samples.clear()
        self._samples.append(_Sample(stamp_ns, tuple(found[name] for name in JOINT_NAMES)))
        while self._samples[0].stamp_ns < stamp_ns - self._keep_ns:
            self._samples.popleft()
        return True

    def at(self, left_stamp_ns: int, right_stamp_ns: int) -> EyeAngles | None:
        """Return the left pan and the tilt at the left image's stamp and the right pan at the right one's.

        Between samples by straight lines. None where nothing is known; a head that never told its joints is taken to
        rest straight ahead, so that images alone can be measured.
        """
        samples = list(self._samples)  # the executor's thread adds while a worker asks
        if not samples:
            return EyeAngles(0.0, 0.0, 0.0)
        left, right = self._interpolated(samples, left_stamp_ns), self._interpolated(samples, right_stamp_ns)
        if left is None or right is None:
            return None
        return EyeAngles(left[_PAN_LEFT], right[_PAN_RIGHT], left[_TILT])

    def told_between(self, begin_ns: int, end_ns: int) -> list[tuple[int, EyeAngles]]:
        """Return the angles that were told between two stamps, with theirs [ns], in order."""
        samples = list(self._samples)
        return [
            (stamp_ns, EyeAngles(angles[_PAN_LEFT], angles[_PAN_RIGHT], angles[_TILT]))
            for stamp_ns, angles in samples
            if begin_ns < stamp_ns < end_ns
        ]

    def _interpolated(self, samples: list[_Sample], stamp_ns: int) -> tuple[float, ...] | None:
        if stamp_ns < samples[0].stamp_ns or stamp_ns > samples[-1].stamp_ns + self._extrapolate_ns:
            return None
        after = bisect_left(samples, stamp_ns, key=lambda sample: sample.stamp_ns)
        if after == len(samples):
            return samples[-1].angles_rad
        if samples[after].stamp_ns == stamp_ns:
            return samples[after].angles_rad
        a, b = samples[after - 1], samples[after]
        share = (stamp_ns - a.stamp_ns) / (b.stamp_ns - a.stamp_ns)
        return tuple(x + share * (y - x) for x, y in zip(a.angles_rad, b.angles_rad, strict=True))
