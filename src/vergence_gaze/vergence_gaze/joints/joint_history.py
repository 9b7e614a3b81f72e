"""Where the eyes were when an image was exposed.

Joint states of a hobby servo are commands passed through a speed limit, not measurements: the shaft follows them with
the play of its dead band and gears. The history therefore keeps, beside the reported angle, an estimate of the shaft's.
A fast servo turns in a small part of the time between two reports: when, the commands and the servos' latency tell.
"""

import math
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import JOINT_NAMES, Rig

Array = npt.NDArray[np.float64]

_KEEP_S = 2.0
_CLOCK_JUMP_S = 1.0
_MOST_COMMANDS = 1000
_INSTANT_S = 1e-4
_STILL = np.zeros(3)


class JointHistory:
    """Reported and estimated joint angles, (3,) in the order of JOINT_NAMES [rad], over the last two seconds."""

    def __init__(self, rig: Rig) -> None:
        servos = [joint.servo for _, joint in rig.joints.items()]
        self._half_play = np.array([0.5 * (servo.dead_band_rad + servo.backlash_rad) for servo in servos])
        self._speed = np.array([servo.speed_rad_s for servo in servos])
        self._latency = np.array([servo.command_latency_s for servo in servos])
        self._longest_latency_s = float(self._latency.max())
        self._commands_s: deque[float] = deque(maxlen=_MOST_COMMANDS)
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
        self._commands_s.clear()

    def commanded(self, now_s: float) -> None:
        """A command is sent now: the joints begin to turn after it by their servos' latency."""
        if not self._commands_s or now_s > self._commands_s[-1]:
            self._commands_s.append(now_s)

    def covers(self, stamp_s: float) -> bool:
        """Tell whether the angles at `stamp_s` are known: not before the first report and not far after the last."""
        return bool(self._stamps) and self._stamps[0] <= stamp_s <= self._stamps[-1] + 0.2

    def shaft_at(self, stamp_s: float) -> Array:
        """Return the estimated shaft angles (3,) at `stamp_s`; the ends are held."""
        reported, i = self._at(stamp_s)
        return np.clip(self._shaft[max(i - 1, 0)], reported - self._half_play, reported + self._half_play)

    def reported_at(self, stamp_s: float) -> Array:
        """Return the angles (3,) at `stamp_s` as they would have been reported then; the ends are held."""
        return self._at(stamp_s)[0]

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

    def _at(self, stamp_s: float) -> tuple[Array, int]:
        """Return the angles (3,) at `stamp_s`, and which report is the first that is not before it."""
        i = bisect_left(self._stamps, stamp_s)
        if i == 0 or i == len(self._stamps):
            return self._reported[min(i, len(self._stamps) - 1)], i
        begin_s, end_s = self._stamps[i - 1], self._stamps[i]
        before, after = self._reported[i - 1], self._reported[i]
        if not (before != after).any():
            return before, i
        onset_s = self._onset_s(begin_s, end_s)
        if onset_s is None:
            return before + (stamp_s - begin_s) / (end_s - begin_s) * (after - before), i
        duration_s = np.maximum(np.abs(after - before) / self._speed, _INSTANT_S)
        onset_s = np.clip(onset_s, begin_s, np.maximum(end_s - duration_s, begin_s))
        return before + np.clip((stamp_s - onset_s) / duration_s, 0.0, 1.0) * (after - before), i

    def _onset_s(self, begin_s: float, end_s: float) -> Array | None:
        """Return when each joint (3,) began to turn between two reports, if a command tells that."""
        for command_s in reversed(self._commands_s):
            if command_s + self._longest_latency_s < begin_s:
                return None
            onset_s = command_s + self._latency
            if (onset_s < end_s).any():
                return onset_s
        return None
