"""Tracks the active goal; decides success, failure or timeout."""

import itertools
import math
from dataclasses import dataclass

from vergence_gaze.goals.goal import Goal, Outcome, Result
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase


@dataclass(frozen=True)
class Progress:
    """The state that decides a goal, in one cycle. `pose_reached` is None unless the goal is a pose.

    `at_point` says why an empty point counts as looked at, `ambiguity` which distances fit, and `images_fault` why the
    images may not be used, each "" while that does not hold; `verged_reason` says why the eyes are verged or not yet,
    `tracking_note` why the last measurement was rejected.
    """

    now_s: float
    verged: bool
    verged_reason: str
    tracking_note: str
    phase: Phase
    in_phase_s: float
    image_s: float
    beyond_limits: bool
    by_class: bool
    pose_reached: bool | None
    at_point: str = ""
    ambiguity: str = ""
    images_fault: str = ""


class GoalMonitor:
    """Numbers goals, tracks the active one, and collects outcomes until they are popped."""

    def __init__(self) -> None:
        self._ids = itertools.count(1)
        self._outcomes: list[Outcome] = []
        self._goal_id: int | None = None
        self._since_s = self._limit_s = math.nan
        self._needs_images = True
        self._limited_since_s = self._ambiguous_since_s = self._faulty_since_s = math.nan

    @property
    def goal_id(self) -> int | None:
        """The active goal, None if there is none."""
        return self._goal_id

    @property
    def has_outcomes(self) -> bool:
        """True while there are outcomes to be popped."""
        return bool(self._outcomes)

    def new_id(self) -> int:
        """Return the id of a new goal."""
        return next(self._ids)

    def reject(self, goal_id: int, result: Result, reason: str) -> None:
        """Record the outcome of a goal that was never started."""
        self._outcomes.append(Outcome(goal_id, result, reason, 0.0))

    def start(self, goal_id: int, goal: Goal, now_s: float, parameters: GazeParameters, slow_s: float = 0.0) -> None:
        """Make a goal the active one; `slow_s` is how much longer it takes for what it asks for."""
        self._goal_id, self._since_s = goal_id, now_s
        self._limit_s = goal.time_limit_s or parameters.control.time_limit_s + slow_s
        self._needs_images = goal.needs_images
        self._limited_since_s = self._ambiguous_since_s = self._faulty_since_s = math.nan

    def end(self, result: Result, reason: str, now_s: float) -> None:
        """End the active goal, if there is one."""
        if self._goal_id is not None:
            self._outcomes.append(Outcome(self._goal_id, result, reason, now_s - self._since_s))
            self._goal_id = None

    def pop_outcomes(self) -> tuple[Outcome, ...]:
        """Return and remove the outcomes since the last call."""
        outcomes, self._outcomes = tuple(self._outcomes), []
        return outcomes

    def update_feedback(self, fault: str, now_s: float, parameters: GazeParameters) -> None:
        """End the active goal if the joints' feedback has had a fault for too long; "" while it has none."""
        self._faulty_since_s = _since(self._faulty_since_s, bool(fault), now_s)
        late = fault and now_s - self._since_s > self._limit_s
        if late or now_s - self._faulty_since_s > parameters.control.no_feedback_s:
            self.end(Result.NO_FEEDBACK, fault, now_s)

    def update(self, p: Progress, parameters: GazeParameters) -> Result | None:
        """End the active goal if it is reached or can no longer be; returns the result, None while it goes on."""
        if self._goal_id is None:
            return None
        self._limited_since_s = _since(self._limited_since_s, p.beyond_limits, p.now_s)
        self._ambiguous_since_s = _since(self._ambiguous_since_s, bool(p.ambiguity), p.now_s)
        ending = self._pose_ending(p) if p.pose_reached is not None else self._target_ending(p, parameters)
        if ending is None:
            return None
        self.end(*ending, p.now_s)
        return ending[0]

    def _pose_ending(self, p: Progress) -> tuple[Result, str] | None:
        if p.pose_reached:
            return Result.VERGED, "the joints are at the requested angles"
        if p.now_s - self._since_s > self._limit_s:
            return Result.TIMED_OUT, "the joints did not reach the requested angles in time"
        return None

    def _target_ending(self, p: Progress, parameters: GazeParameters) -> tuple[Result, str] | None:
        if p.verged:
            return Result.VERGED, p.verged_reason
        if p.at_point:
            return Result.AT_POINT, p.at_point
        if p.now_s - self._limited_since_s > parameters.control.limits_after_s:
            return Result.LIMITS, "the target is beyond the joints' limits"
        if p.now_s - self._ambiguous_since_s > parameters.control.ambiguous_after_s:
            return Result.AMBIGUOUS, p.ambiguity
        if self._needs_images and p.now_s - max(p.image_s, self._since_s) > parameters.control.no_images_s:
            return Result.NO_IMAGES, p.images_fault or "no results from the images arrive"
        if p.now_s - self._since_s > self._limit_s:
            if p.ambiguity:
                return Result.AMBIGUOUS, p.ambiguity
            lost = p.phase in (Phase.LOST, Phase.SEARCH)
            return (Result.LOST if lost else Result.TIMED_OUT), p.tracking_note or p.verged_reason
        if p.phase is Phase.SEARCH and not p.by_class and p.in_phase_s > parameters.control.search_limit_s:
            return Result.LOST, "the target was not found again"
        return None


def _since(since_s: float, holds: bool, now_s: float) -> float:
    if not holds:
        return math.nan
    return now_s if math.isnan(since_s) else since_s
