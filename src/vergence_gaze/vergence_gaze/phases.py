"""The phases of gaze, and the transitions between them."""

import enum
import math
from dataclasses import dataclass

from vergence_gaze.parameters import GazeParameters

_LANDING_TIMEOUT_S = 0.35
_SACCADE_AGAIN_S = 0.08


class Phase(enum.IntEnum):
    """As GazeState's constants."""

    IDLE = 0
    SEARCH = 1
    SACCADE = 2
    VERGE = 3
    FIXATE = 4
    LOST = 5


@dataclass(frozen=True)
class Situation:
    """The state that the transitions depend on, in one cycle."""

    now_s: float
    active: bool
    has_target: bool
    unseen_s: float
    residual_rad: float
    eyes_still: bool
    travel_s: float
    verged: bool
    may_search: bool


class PhaseMachine:
    """The present phase, since when, and why."""

    def __init__(self, parameters: GazeParameters) -> None:
        self._p = parameters
        self.phase = Phase.IDLE
        self.reason = "idle: no goal yet"
        self.since_s = -math.inf
        self._land_by_s = -math.inf
        self._landed_s = -math.inf

    def enter(self, phase: Phase, reason: str, now_s: float) -> None:
        """Enter a phase for a reason of the caller's; for the present phase only the reason changes."""
        if phase is not self.phase:
            self.phase, self.since_s = phase, now_s
        self.reason = reason

    def update(self, s: Situation) -> Phase:
        """Return the phase for this situation."""
        if not s.active:
            if self.phase is not Phase.IDLE:
                self.enter(Phase.IDLE, "idle: holding still", s.now_s)
            return self.phase
        if not s.has_target:
            self._without_target(s)
        elif self.phase is Phase.SACCADE:
            self._in_saccade(s)
        elif s.unseen_s > self._p.target.lost_after_s:
            self._unseen(s)
        elif s.residual_rad > self._p.saccade.threshold_rad and s.now_s - self._landed_s > _SACCADE_AGAIN_S:
            self._land_by_s = s.now_s + s.travel_s + _LANDING_TIMEOUT_S
            self.enter(Phase.SACCADE, f"gaze error {math.degrees(s.residual_rad):.1f} deg", s.now_s)
        elif s.verged:
            self.enter(Phase.FIXATE, "the eyes are verged on the target", s.now_s)
        else:
            self.enter(Phase.VERGE, f"gaze error {math.degrees(s.residual_rad):.2f} deg", s.now_s)
        return self.phase

    def _in_saccade(self, s: Situation) -> None:
        if s.eyes_still and s.now_s - self.since_s > 0.01:
            self._landed_s = s.now_s
            self.enter(Phase.VERGE, "the saccade has ended: the eyes are still", s.now_s)
        elif s.now_s > self._land_by_s:
            self._landed_s = s.now_s
            self.enter(Phase.VERGE, "the saccade did not end in time", s.now_s)

    def _without_target(self, s: Situation) -> None:
        if self.phase not in (Phase.LOST, Phase.SEARCH):
            self.enter(Phase.LOST, "no target seen yet", s.now_s)
        elif self.phase is Phase.LOST and s.may_search and s.now_s - self.since_s > self._p.search.dwell_s:
            self.enter(Phase.SEARCH, "no target in view: searching", s.now_s)

    def _unseen(self, s: Situation) -> None:
        if self.phase is Phase.SEARCH:
            return
        if self.phase is not Phase.LOST:
            self.enter(Phase.LOST, f"target not seen for {s.unseen_s:.1f} s", s.now_s)
        elif s.may_search and s.now_s - self.since_s > self._p.search.after_s:
            self.enter(Phase.SEARCH, "target not seen again where it was lost: searching", s.now_s)
