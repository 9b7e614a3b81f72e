"""Joint states as they arrive: checked, what is refused counted with its reason, joints of several messages merged.

Every node that reads joint_states reads them by this, so that all refuse the same.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from vergence_rig.report import ERROR, OK, WARN, Report
from vergence_rig.rig import JOINT_NAMES

_MS_NS = 1_000_000
_FUTURE_NS = 250 * _MS_NS
_CLOCK_JUMP_NS = 1_000 * _MS_NS
_RESTART_AFTER = 3
_ONE_CYCLE_NS = 60 * _MS_NS
_LARGEST_RAD = math.tau
_SILENT_S = 1.0
_RECENT_S = 3.0
_NAMES_SHOWN = 3
_LONGEST_NAME = 40

FOREIGN = "foreign_names"
"""Kind of refusal of messages about other joints, which a topic shared with other devices carries all the time."""


class MergedJoints(NamedTuple):
    """Angles [rad] of all joints, in the order of JOINT_NAMES, and their stamp [ns]."""

    stamp_ns: int
    angles_rad: tuple[float, ...]


class _Angle(NamedTuple):
    stamp_ns: int
    rad: float


@dataclass(slots=True)
class _Joint:
    """The two newest angles of one joint."""

    before: _Angle | None
    newest: _Angle

    def reported_within_a_cycle_of(self, stamp_ns: int) -> bool:
        """Return whether the joint's next report is due rather than missing at `stamp_ns`."""
        if self.newest.stamp_ns == stamp_ns:
            return True
        if self.before is None:
            return False
        interval_ns = self.newest.stamp_ns - self.before.stamp_ns
        return interval_ns <= _ONE_CYCLE_NS and stamp_ns - self.newest.stamp_ns <= 1.5 * interval_ns

    def at(self, stamp_ns: int) -> float:
        """Return the angle at a stamp, on the straight line between the two newest; their ends are held."""
        before, newest = self.before, self.newest
        if before is None or stamp_ns >= newest.stamp_ns:
            return newest.rad
        share = (stamp_ns - before.stamp_ns) / (newest.stamp_ns - before.stamp_ns)
        return before.rad + max(share, 0.0) * (newest.rad - before.rad)


class JointStateReader:
    """Checks messages and merges them. A message is used or refused as a whole; joints of other names are ignored.

    While one message has all joints, it is passed on as it is. Joints that come in several messages are merged at the
    oldest of their newest stamps, each on the line between its own two newest angles; one whose next message is overdue
    keeps its newest angle, and `report` names it.
    """

    def __init__(self) -> None:
        self.received = self.merged = 0
        self.refused: Counter[str] = Counter()
        """Refused messages by kind."""
        self._joints: dict[str, _Joint] = {}
        self._merged_ns: int | None = None
        self._backwards = 0
        self._refusal, self._refused_s = "", -math.inf
        self._merged_s = -math.inf
        self._arrived_s: dict[str, float] = {}
        self._age_ns = 0

    def read(
        self, stamp_ns: int, names: Sequence[str], positions_rad: Sequence[float], clock_ns: int, now_s: float
    ) -> MergedJoints | None:
        """Return the angles of all joints that this message completes; None if it is refused or completes none.

        Args:
            stamp_ns: the message's stamp.
            names: of its joints.
            positions_rad: of these joints.
            clock_ns: the present on the clock of the stamps; 0 while that clock has no time yet.
            now_s: the present on a steady clock.
        """
        self.received += 1
        found, kind, why = _checked(names, positions_rad)
        if not kind:
            kind, why = self._check_stamp(found, stamp_ns, clock_ns)
        if kind:
            self.refused[kind] += 1
            # Other devices' joints on one topic are no fault while this head's arrive too.
            if kind != FOREIGN or not self._joints:
                self._refusal, self._refused_s = why, now_s
            return None
        self._age_ns = clock_ns - stamp_ns
        for name, rad in found.items():
            known = self._joints.get(name)
            self._joints[name] = _Joint(known.newest if known else None, _Angle(stamp_ns, rad))
            self._arrived_s[name] = now_s
        return self._merge(now_s)

    def clear(self) -> None:
        """Remove all angles: the clock was set. The counts stay."""
        self._joints.clear()
        self._arrived_s.clear()
        self._merged_ns, self._backwards = None, 0

    def problem(self, now_s: float, silent_after_s: float = _SILENT_S) -> str:
        """Return why no usable joint state arrives at `now_s` on the steady clock; empty while they do."""
        if now_s - self._merged_s <= silent_after_s:
            return ""
        refusal = f"refused: {self._refusal}" if now_s - self._refused_s <= max(silent_after_s, _SILENT_S) else ""
        missing = [name for name in JOINT_NAMES if name not in self._joints]
        if not self.received:
            return "no joint_states have arrived"
        if refusal:
            return f"joint_states are {refusal}"
        if missing and self._joints:
            return f"joint_states lack {', '.join(missing)}"
        if not math.isfinite(self._merged_s):
            return f"joint_states have stopped; all were refused: {self._refusal}"
        return f"joint_states have stopped {now_s - self._merged_s:.1f} s ago"

    def report(self, now_s: float) -> Report:
        """Return the diagnostic at `now_s` on the steady clock."""
        values: dict[str, object] = {"received": self.received, "used": self.merged}
        values |= {f"refused_{kind}": count for kind, count in self.refused.items()}
        if self.merged:
            values["age_ms"] = self._age_ns / _MS_NS
        problem = self.problem(now_s)
        if problem:
            return Report(ERROR if self.received else WARN, f"{problem}: what depends on the joints is NaN", values)
        silent = [name for name, arrived_s in self._arrived_s.items() if now_s - arrived_s > _SILENT_S]
        if silent:
            return Report(WARN, f"joint_states no longer have {', '.join(silent)}: the last angle is used", values)
        if now_s - self._refused_s <= _RECENT_S:
            return Report(WARN, f"some joint_states are refused: {self._refusal}", values)
        return Report(OK, "all joints are reported", values)

    def _check_stamp(self, found: dict[str, float], stamp_ns: int, clock_ns: int) -> tuple[str, str]:
        """Return kind and reason of a refusal; both empty if the stamp is in order. Starts again where time was set."""
        if stamp_ns <= 0:
            return "zero_stamp", "the stamp must be set: it is zero"
        if clock_ns > 0 and stamp_ns - clock_ns > _FUTURE_NS:
            ahead_s = (stamp_ns - clock_ns) * 1e-9
            return "future_stamp", f"the stamp must not be in the future: it is {ahead_s:.3g} s ahead of the clock"
        newest_ns = max((self._joints[name].newest.stamp_ns for name in found if name in self._joints), default=None)
        if newest_ns is None or stamp_ns > newest_ns:
            self._backwards = 0
            return "", ""
        if stamp_ns == newest_ns:
            return "repeated_stamp", "stamps must increase: one came twice"
        self._backwards += 1
        if newest_ns - stamp_ns > _CLOCK_JUMP_NS and self._backwards >= _RESTART_AFTER:
            self.clear()  # no stray message: the clock was set back
            return "", ""
        return "backward_stamp", f"stamps must increase: one ran back by {(newest_ns - stamp_ns) * 1e-9:.3g} s"

    def _merge(self, now_s: float) -> MergedJoints | None:
        if len(self._joints) < len(JOINT_NAMES):
            return None
        newest_ns = max(joint.newest.stamp_ns for joint in self._joints.values())
        stamps_ns = [j.newest.stamp_ns for j in self._joints.values() if j.reported_within_a_cycle_of(newest_ns)]
        stamp_ns = min(stamps_ns)
        if self._merged_ns is not None and stamp_ns <= self._merged_ns:
            return None
        self._merged_ns, self._merged_s = stamp_ns, now_s
        self.merged += 1
        return MergedJoints(stamp_ns, tuple(self._joints[name].at(stamp_ns) for name in JOINT_NAMES))


def _checked(names: Sequence[str], positions_rad: Sequence[float]) -> tuple[dict[str, float], str, str]:
    """Return the head's joints of a message, and kind and reason of its refusal, both empty if it is in order."""
    if not any(name in JOINT_NAMES for name in names):
        return {}, FOREIGN, f"names must be {', '.join(JOINT_NAMES)}: got {_shown(names)}"
    if not len(positions_rad):
        return {}, "no_positions", "positions must be given: the message has none (velocities or efforts alone)"
    if len(positions_rad) != len(names):
        return {}, "sizes", f"there must be one position for each name: got {len(positions_rad)} for {len(names)} names"
    pairs = [(name, float(rad)) for name, rad in zip(names, positions_rad, strict=True) if name in JOINT_NAMES]
    found = dict(pairs)
    if len(found) != len(pairs):
        return {}, "names_twice", "each joint must be named once: one is named twice"
    for name, rad in pairs:
        if not math.isfinite(rad):
            return {}, "not_finite", f"{name} must be a finite angle: got {rad}"
        if abs(rad) > _LARGEST_RAD:
            return {}, "too_large", f"{name} must be -2 pi to 2 pi [rad]: got {rad:.4g}"
    return found, "", ""


def _shown(names: Sequence[str]) -> str:
    if not len(names):
        return "no name"
    shown = ", ".join(str(name)[:_LONGEST_NAME] for name in names[:_NAMES_SHOWN])
    return f"{shown}, ..." if len(names) > _NAMES_SHOWN else shown
