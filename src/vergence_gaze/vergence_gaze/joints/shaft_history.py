"""Where the eyes were when an image was exposed.

Joint states of a hobby servo are commands passed through a speed limit, not measurements: the shaft follows them with
the play of its dead band and gears. Beside the reported angles there is therefore an estimate of the shafts'. A fast
servo turns in a small part of the time between two reports; the commands and the servos' latency give when.
"""

import math
from collections import deque
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from vergence_gaze.joints.play_estimator import PlayEstimator
from vergence_rig.joint_history import JointHistory, JointSample, interpolated
from vergence_rig.rig import JOINT_NAMES, Rig

Array = npt.NDArray[np.float64]

_KEEP_S = 3.0
_HOLD_S = 0.2
_CLOCK_JUMP_S = 1.0
_MOST_COMMANDS = 1000
_MOST_FOUND = 32  # angles kept where no report and no command comes that ends them
_INSTANT_S = 1e-4
_STILL = np.zeros(3)


class ShaftHistory:
    """Reported and estimated joint angles, (3,) in the order of JOINT_NAMES [rad], over the last seconds."""

    def __init__(self, rig: Rig, play_learning: float = 0.0) -> None:
        servos = [joint.servo for _, joint in rig.joints.items()]
        described = np.array([servo.half_play_rad for servo in servos])
        self.play = PlayEstimator(described, play_learning)
        self._speed = np.array([servo.speed_rad_s for servo in servos])
        self._latency = np.array([servo.command_latency_s for servo in servos])
        self._longest_latency_s = float(self._latency.max())
        self._commands: deque[tuple[float, Array]] = deque(maxlen=_MOST_COMMANDS)
        self._reported = JointHistory(_KEEP_S, _HOLD_S)
        self._shafts = JointHistory(_KEEP_S, _HOLD_S)
        self._found: dict[float, Array] = {}  # of `shaft_at`, since the last change
        self._found_with = self.play.half_play_rad

    @property
    def known(self) -> bool:
        """True once every joint has been reported."""
        return self._reported.known

    @property
    def newest_s(self) -> float:
        """Stamp of the newest report; NaN before the first."""
        return self._reported.newest.stamp if self._reported.known else math.nan

    @property
    def reported_rad(self) -> Array:
        """The newest reported angles (3,)."""
        return self._reported.newest.angles_rad

    @property
    def shaft_rad(self) -> Array:
        """The newest estimated shaft angles (3,), with the play as it is known by now."""
        return self.shaft_at(math.inf)

    @property
    def sent_rad(self) -> Array:
        """Where the shafts (3,) will rest once the newest command has been executed."""
        return self._carried(self.shaft_rad, self._commands[-1][1]) if self._commands else self.shaft_rad

    def _carried(self, shaft_rad: Array, joint_rad: Array) -> Array:
        return np.minimum(np.maximum(shaft_rad, joint_rad - self.half_play_rad), joint_rad + self.half_play_rad)

    @property
    def half_play_rad(self) -> Array:
        """Half of each joint's dead band and backlash together (3,), as described and corrected by what was seen."""
        return self.play.half_play_rad

    def add(self, stamp_s: float, positions_rad: Mapping[str, float]) -> bool:
        """Add one report; a joint that it lacks keeps its last angle.

        Returns False, and adds nothing, for a late stamp, or while a joint has never been reported. A stamp that runs
        back by more than a second means that the clock was set: the history starts again.
        """
        if not math.isfinite(stamp_s):
            return False
        if self.known and stamp_s < self.newest_s - _CLOCK_JUMP_S:
            self.clear()
        if self.known and stamp_s <= self.newest_s:
            return False
        before = self.reported_rad.tolist() if self.known else [math.nan] * 3
        values = [float(positions_rad.get(name, math.nan)) for name in JOINT_NAMES]
        # False for a NaN, too.
        angles = np.array([new if abs(new) <= math.tau else old for new, old in zip(values, before, strict=True)])
        shafts = self._shafts.newest.angles_rad if self.known else angles
        self._found.clear()
        if not self._reported.add_angles(stamp_s, angles):
            return False
        self.play.follow(stamp_s, angles)
        return self._shafts.add_angles(stamp_s, self._carried(shafts, angles))

    def clear(self) -> None:
        """Remove all reports and commands."""
        self._reported.clear()
        self._shafts.clear()
        self._commands.clear()
        self._found.clear()
        self.play.forget_way()

    def on_command(self, now_s: float, angles_rad: Array) -> None:
        """Record a command (3,) that is sent now: the joints begin to turn after it by their servos' latency."""
        if not self._commands or now_s > self._commands[-1][0]:
            self._commands.append((now_s, angles_rad))
            self._found.clear()

    def sent_since(self, stamp_s: float) -> float:
        """Return how far the newest command is from the last one before a stamp, of the farthest joint [rad]."""
        before = next((angles for sent_s, angles in reversed(self._commands) if sent_s <= stamp_s), None)
        return 0.0 if before is None else float(np.abs(self._commands[-1][1] - before).max())

    def covers(self, stamp_s: float) -> bool:
        """Return whether the angles at `stamp_s` are known: not before the first report, nor long after the last."""
        return self._reported.covers(stamp_s)

    def shaft_at(self, stamp_s: float) -> Array:
        """Return the estimated shaft angles (3,) at `stamp_s`; the ends are held. They must not be changed."""
        if self._found_with is not self.half_play_rad or len(self._found) > _MOST_FOUND:
            self._found_with = self.half_play_rad
            self._found.clear()
        found = self._found.get(stamp_s)
        if found is None:
            before, _ = self._shafts.bracket(stamp_s)
            found = self._found[stamp_s] = self._carried(before.angles_rad, self.reported_at(stamp_s))
        return found

    def reported_at(self, stamp_s: float) -> Array:
        """Return the angles (3,) at `stamp_s` as they would have been reported then; the ends are held."""
        before, after = self._reported.bracket(stamp_s)
        if before is after or not (before.angles_rad != after.angles_rad).any():
            return before.angles_rad
        onset_s = self._onset_s(before.stamp, after.stamp)
        if onset_s is None:
            return interpolated(before, after, stamp_s)
        return self._turning_from(onset_s, before, after, stamp_s)

    def speed_within(self, begin_s: float, end_s: float, along_rad_s: Array = _STILL) -> float:
        """Return the fastest joint's greatest speed between two times [rad/s]; 0 where nothing is known.

        With `along_rad_s` (3,) it is the speed relative to these: how fast the eyes slip off a target that moves so.
        """
        fastest, along = 0.0, along_rad_s.tolist()
        before: list[float] | None = None
        began_s = math.nan
        for ended_s, angles_rad in self._reported.spanning(begin_s, end_s):
            after = angles_rad.tolist()
            if before is not None:
                duration_s = max(ended_s - began_s, _INSTANT_S)
                for first, last, own in zip(before, after, along, strict=True):
                    speed = abs((last - first) / duration_s - own)
                    if speed > fastest:
                        fastest = speed
            began_s, before = ended_s, after
        return fastest

    def _turning_from(self, onset_s: Array, before: JointSample, after: JointSample, stamp_s: float) -> Array:
        """Return the angles (3,) between two reports of joints that began to turn at `onset_s` (3,)."""
        way = after.angles_rad - before.angles_rad
        duration_s = np.maximum(np.abs(way) / self._speed, _INSTANT_S)
        onset_s = np.clip(onset_s, before.stamp, np.maximum(after.stamp - duration_s, before.stamp))
        return before.angles_rad + np.clip((stamp_s - onset_s) / duration_s, 0.0, 1.0) * way

    def _onset_s(self, begin_s: float, end_s: float) -> Array | None:
        """Return when each joint (3,) began to turn between two reports, None without a command for it."""
        for command_s, _ in reversed(self._commands):
            if command_s + self._longest_latency_s < begin_s:
                return None
            onset_s = command_s + self._latency
            if (onset_s < end_s).any():
                return onset_s
        return None
