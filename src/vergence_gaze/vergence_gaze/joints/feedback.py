"""Whether the joints' feedback can be relied on: joint states arrive, in time, and the joints follow their commands."""

import math

import numpy as np
import numpy.typing as npt

from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_rig.rig import JOINT_NAMES

Array = npt.NDArray[np.float64]

NO_JOINTS = "no joint_states have arrived"
_SILENT_S = 0.5
_LATE_S = 0.2  # images newer than the joint states by more are of unknown pose
_PERSISTS_S = 0.4
_OFF_RAD = math.radians(2.0)
_MOVED_RAD = 0.002


class FeedbackMonitor:
    """Watches the history of joint states and the commands; `fault` says what is wrong, "" while nothing is.

    A joint that rests more than 2 degrees off its command for 0.4 s does not follow it: its servo is stuck or off, or
    the joint states are frozen. That fault ends when the joint is reported to move, or is no longer sent elsewhere.
    """

    def __init__(self) -> None:
        self.fault = ""
        self.clear()

    def clear(self) -> None:
        """Forget what was seen: the clock was set."""
        self._newest_s = self._arrived_s = self._on_time_s = math.nan
        self.retry()

    def retry(self) -> None:
        """Let joints that did not follow be tried again: there is a new goal."""
        self._rests_at = [math.nan] * 3
        self._off_since_s = [math.inf] * 3

    def update(
        self, now_s: float, history: ShaftHistory, sent_rad: Array | None, driven: npt.NDArray[np.bool_], refusal: str
    ) -> str:
        """Return the fault at `now_s`.

        Args:
            now_s: the present.
            history: of the joint states.
            sent_rad: the last command (3,), None while none is sent.
            driven: (3,) which joints the commands move.
            refusal: why the reader of joint_states passes none on; empty while it does.
        """
        if not history.known:
            self.fault = refusal or NO_JOINTS
            return self.fault
        if history.newest_s != self._newest_s:
            self._newest_s, self._arrived_s = history.newest_s, now_s
        if not now_s - history.newest_s > _LATE_S or math.isnan(self._on_time_s):
            self._on_time_s = now_s
        self.fault = self._timing_fault(now_s, refusal)
        if self.fault or sent_rad is None:
            self._off_since_s = [math.inf] * 3
        else:
            self.fault = self._joint_fault(now_s, history.reported_rad, sent_rad, driven)
        return self.fault

    def _timing_fault(self, now_s: float, refusal: str) -> str:
        silent_s = now_s - self._arrived_s
        if silent_s > _SILENT_S:
            return refusal or f"joint_states have stopped {silent_s:.1f} s ago"
        if now_s - self._on_time_s > _PERSISTS_S:
            return f"joint_states are late: the newest is of {now_s - self._newest_s:.2f} s ago"
        return ""

    def _joint_fault(self, now_s: float, reported_rad: Array, sent_rad: Array, driven: npt.NDArray[np.bool_]) -> str:
        stuck = []
        for i, (reported, sent) in enumerate(zip(reported_rad.tolist(), sent_rad.tolist(), strict=True)):
            rests = abs(reported - self._rests_at[i]) <= _MOVED_RAD
            if not rests:
                self._rests_at[i] = reported
            off = rests and driven[i] and abs(sent - reported) > _OFF_RAD
            self._off_since_s[i] = min(self._off_since_s[i], now_s) if off else math.inf
            if now_s - self._off_since_s[i] > _PERSISTS_S:
                stuck.append(i)
        if not stuck:
            return ""
        places = ", ".join(
            f"{JOINT_NAMES[i]} is reported at {math.degrees(reported_rad[i]):.1f} deg, commanded to "
            f"{math.degrees(sent_rad[i]):.1f}"
            for i in stuck
        )
        return f"joints do not follow their commands (stuck servo, or frozen joint_states): {places}"
