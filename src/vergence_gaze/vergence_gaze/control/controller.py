"""The gaze controller: observations in, joint commands out, one call a cycle. No ROS, no clock of its own."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_gaze.control.perception import LATEST_FUTURE_S, Perception
from vergence_gaze.control.report import Command, GazeReport, report_of
from vergence_gaze.control.search_pattern import Searcher
from vergence_gaze.estimation.directions import spread_of_eye
from vergence_gaze.estimation.observations import JointResolution, Observation, PointSighting
from vergence_gaze.estimation.vergence_offset import VergenceOffset
from vergence_gaze.goals.goal import Goal, GoalError, Result
from vergence_gaze.goals.goal_monitor import GoalWatch, Progress
from vergence_gaze.goals.goal_start import WantedClass, WantedPose, start_of
from vergence_gaze.joints.frames import point_in_rig
from vergence_gaze.joints.limits import CommandLimits
from vergence_gaze.joints.resolution import pulse_steps_rad, rig_with_steps
from vergence_gaze.laws import LawView, make_law
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase, PhaseMachine, Situation
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_LIMITED_RAD = math.radians(1.0)
_HOLD_S = 0.3
_CLOCK_JUMP_S = 1.0
_UNKNOWN = np.full(3, np.nan)


class GazeController:
    """Steers both eyes and the tilt onto a target and holds them there.

    Time is the caller's, in seconds; the stamps of observations are of the same clock.
    """

    def __init__(self, rig: Rig, parameters: GazeParameters, period_s: float = 0.01) -> None:
        self._rig, self._period_s = rig, period_s
        self._limits = CommandLimits(rig)
        self._goals = GoalWatch()
        self._enabled = True
        self._pose: Array | None = None
        self._rest = _UNKNOWN
        self._command: Array | None = None
        self._command_s = math.nan
        self._send_until_s = -math.inf
        self._beyond_limits = False
        self._seen = Perception(rig, parameters, _driven(parameters))
        self._set(parameters)
        self._active = self._verges_on_sight = parameters.start == "verge"

    def _set(self, parameters: GazeParameters) -> None:
        rig, self._p = self._rig, parameters
        self._driven = _driven(parameters)
        self._seen.set(parameters, self._driven)
        self._phases = PhaseMachine(parameters)
        self._law = make_law(rig, parameters)
        self._searcher = Searcher(
            rig, parameters.tilt_enabled, parameters.prior_vergence_rad, parameters.search_dwell_s
        )
        self._lead_s = max(joint.servo.command_latency_s for _, joint in rig.joints.items()) + 0.5 * self._period_s

    @property
    def vergence_offset(self) -> VergenceOffset:
        """What the visual encoder has told of the shafts."""
        return self._seen.vergence_offset

    @property
    def resolution_rad(self) -> Array:
        """The smallest step of each joint (3,) [rad]: as its driver says, else as the rig's description says."""
        return pulse_steps_rad(self._rig)

    @property
    def goal_id(self) -> int | None:
        """The goal in hand, None if there is none."""
        return self._goals.goal_id

    def set_parameters(self, parameters: GazeParameters, now_s: float) -> None:
        """Take other parameters: a goal in hand ends as CANCELLED and the eyes hold still."""
        self._begin_anew("the parameters were changed", parameters, now_s)

    def frame_to_rig(self, point_m: Any, frame: str, stamp_s: float) -> tuple[float, float, float]:
        """Return a point of a frame (see frames.FRAMES) in rig_base [m], with the joints as they were at `stamp_s`.

        Raises FrameError for a frame it does not know, or before any joint is known.
        """
        return point_in_rig(point_m, frame, stamp_s, self._seen.history, self._rig.baseline_m)

    def look_at(self, goal: Goal, now_s: float) -> int:
        """Begin a goal and return its id; the one in hand ends as PREEMPTED.

        A goal that cannot be begun also gets an id; its outcome comes with the next step.
        """
        goal_id = self._goals.number()
        try:
            if not self._enabled:
                raise GoalError(Result.INVALID, "the controller is disabled: enable it first")
            wanted = start_of(goal, self._rig, self._p, self._seen.history, now_s)
        except GoalError as error:
            self._goals.refuse(goal_id, error.result, error.reason)
            return goal_id
        self._goals.end(Result.PREEMPTED, "a newer goal took its place", now_s)
        self._goals.begin(goal_id, goal, now_s, self._p)
        self._active, self._pose, self._verges_on_sight = True, None, False
        self._seen.judge.restart()
        self._law.reset()
        self._searcher.stop()
        if isinstance(wanted, WantedPose):
            self._seen.tracking.clear()
            self._pose = np.where(self._driven, wanted.joints_rad, np.nan)
        elif isinstance(wanted, WantedClass):
            self._seen.tracking.want_class(now_s, wanted.class_name)
        else:
            self._seen.tracking.want(now_s, wanted.stamp_s, wanted.angles_rad, wanted.covariance)
        self._phases.enter(Phase.VERGE, "new goal", now_s)
        return goal_id

    def cancel(self, now_s: float, goal_id: int | None = None) -> bool:
        """End the goal in hand (or only if it is `goal_id`) as CANCELLED and hold still; False if there is none."""
        if self._goals.goal_id is None or goal_id not in (None, self._goals.goal_id):
            return False
        self._goals.end(Result.CANCELLED, "cancelled", now_s)
        self._hold("cancelled", now_s)
        return True

    def stop(self, now_s: float) -> None:
        """End any goal and hold still where the eyes are."""
        self._goals.end(Result.CANCELLED, "stopped", now_s)
        self._hold("stopped", now_s)

    def enable(self, enabled: bool, now_s: float) -> None:
        """Disable: hold still and send nothing. Enable: without a goal, verge on what the eyes see."""
        self._enabled = enabled
        if not enabled:
            self._goals.end(Result.CANCELLED, "disabled", now_s)
            self._hold("disabled", now_s)
            self._send_until_s = -math.inf
        elif not self._active:
            self._active = self._verges_on_sight = True
            self._seen.tracking.clear()

    def step(self, now_s: float, observations: Iterable[Observation] = ()) -> Command:
        """Take what arrived since the last cycle and return what to command now.

        A clock that runs back by more than a second was set: the eyes hold still and everything begins anew.
        """
        if now_s < self._command_s - _CLOCK_JUMP_S:
            self._seen.forget()
            self._command_s = now_s
            self._begin_anew("the clock was set back", self._p, now_s)
        for observation in observations:
            self._observe(observation, now_s)
        if not self._seen.history.known or not math.isfinite(now_s):
            return Command(None, self._report(now_s), self._goals.take_outcomes())
        sending = self._enabled and (self._active or now_s < self._send_until_s)
        if self._command is None or not sending:
            # Idle, somebody else may move the joints: begin from where they are.
            self._command, self._command_s = self._limits.nearest(self._seen.history.reported_rad), now_s
        wanted = self._decide(now_s, self._command) if self._active else self._rest
        sent = self._limits.sent(wanted, self._command, now_s - self._command_s, self._seen.history.reported_rad)
        self._note_limits(wanted)
        self._command, self._command_s = sent, max(now_s, self._command_s)
        if sending:
            self._seen.history.commanded(now_s)
        self._watch_goal(now_s)
        return Command(sent if sending else None, self._report(now_s), self._goals.take_outcomes())

    def _observe(self, observation: Observation, now_s: float) -> None:
        if isinstance(observation, JointResolution):
            self._learn_steps(observation)
            return
        known = self._seen.history.known and observation.stamp_s <= now_s + LATEST_FUTURE_S
        if isinstance(observation, PointSighting) and known and self._goals.goal_id is None and self._enabled:
            self._follow_stream(now_s)
        verging = self._phases.phase in (Phase.VERGE, Phase.FIXATE)
        self._seen.take(observation, now_s, self._law, verging)

    def _learn_steps(self, resolution: JointResolution) -> None:
        rig = rig_with_steps(self._rig, resolution.steps_rad)
        if rig != self._rig:
            self._rig = rig
            self._seen.set_rig(rig)
            self._law = make_law(rig, self._p)

    def _follow_stream(self, now_s: float) -> None:
        if not self._seen.tracking.takes_stream:
            self._seen.tracking.want_stream(now_s)
            self._seen.judge.restart("a target is given by its position")
            self._active, self._pose, self._verges_on_sight = True, None, False

    def _decide(self, now_s: float, command: Array) -> Array:
        """Return the wanted joint angles (3,), NaN for joints that stay."""
        if self._pose is not None:
            self._phases.enter(Phase.SACCADE, "to the angles asked for", now_s)
            return self._pose
        if self._verges_on_sight and not self._seen.tracking.filter.initialised:
            self._take_what_is_seen(now_s)
        phase = self._phases.advance(self._situation(self._view(now_s, command)))
        if phase is Phase.SEARCH:
            place = self._searcher.wanted(now_s, self._seen.history.shaft_rad, self._limits.speed_rad_s)
            return np.where(self._driven, place, np.nan)
        self._searcher.stop()
        if phase in (Phase.LOST, Phase.IDLE):
            self._seen.judge.restart("the target is lost")
            return _UNKNOWN
        if phase is Phase.SACCADE and self._seen.judge.verged:
            self._seen.judge.restart("the eyes are on their way to the target")
        if self._seen.tracking.disagreement:
            self._phases.enter(Phase.VERGE, "estimators disagree: holding still", now_s)
            return _UNKNOWN
        return self._law.wanted(self._view(now_s, command))

    def _take_what_is_seen(self, now_s: float) -> None:
        self._phases.enter(Phase.VERGE, "verging on what the left eye looks at", now_s)
        left, right, tilt = self._seen.history.shaft_rad
        spread = spread_of_eye(True, self._p.direction_sigma_rad, self._p.prior_vergence_sigma_rad)
        self._seen.tracking.want(now_s, now_s, np.array([0.5 * (left + right), right - left, tilt]), spread)

    def _view(self, now_s: float, command: Array) -> LawView:
        return LawView(
            now_s=now_s,
            elapsed_s=max(now_s - self._command_s, 0.0),
            phase=self._phases.phase,
            target=self._seen.tracking.filter,
            visual=self._seen.tracking.visual,
            contrast=self._seen.contrast,
            shaft_rad=self._seen.history.shaft_rad,
            commanded_rad=command,
            driven=self._driven,
            speed_rad_s=self._limits.speed_rad_s,
            lead_s=self._lead_s,
        )

    def _situation(self, view: LawView) -> Situation:
        tracking, residual = self._seen.tracking, np.zeros(3)
        has_target = tracking.filter.initialised
        if has_target:
            # What lies beyond the limits is no residual that turning could still mend.
            reachable = self._limits.nearest(view.shaft_rad + self._law.residual(view))
            residual = np.where(self._driven, reachable - view.shaft_rad, 0.0)
        lost_s = view.now_s - self._phases.since_s if self._phases.phase is Phase.LOST else 0.0
        return Situation(
            now_s=view.now_s,
            active=self._active,
            has_target=has_target,
            unseen_s=self._seen.unseen_s(view.now_s),
            residual_rad=float(np.abs(residual).max()),
            eyes_still=self._seen.eyes_still(view.now_s, view.commanded_rad, self._law.lands_at_rest),
            travel_s=float((np.abs(residual) / view.speed_rad_s).max()),
            verged=self._seen.judge.verged,
            may_search=tracking.class_name is not None or tracking.takes_stream or lost_s > self._p.search_after_s,
        )

    def _note_limits(self, wanted: Array) -> None:
        finite = np.isfinite(wanted)
        beyond = np.abs(wanted - self._limits.nearest(np.where(finite, wanted, 0.0)))[finite]
        self._beyond_limits = bool(beyond.size and beyond.max() > _LIMITED_RAD)

    def _watch_goal(self, now_s: float) -> None:
        if self._goals.goal_id is None or self._command is None:
            return
        pose_reached: bool | None = None
        if self._pose is not None:
            pose_reached = self._seen.at(self._pose) and self._seen.eyes_still(now_s, self._command)
        progress = Progress(
            now_s=now_s,
            verged=self._seen.judge.verged,
            judged=self._seen.judge.reason,
            note=self._seen.tracking.note,
            phase=self._phases.phase,
            in_phase_s=now_s - self._phases.since_s,
            image_s=self._seen.image_s,
            beyond_limits=self._beyond_limits,
            disagreement=self._seen.tracking.disagreement,
            by_class=self._seen.tracking.class_name is not None,
            pose_reached=pose_reached,
        )
        if self._goals.watch(progress, self._p) is Result.VERGED and pose_reached:
            self._hold("at the angles asked for", now_s)

    def _begin_anew(self, reason: str, parameters: GazeParameters, now_s: float) -> None:
        self._goals.end(Result.CANCELLED, reason, now_s)
        self._set(parameters)
        self._hold(reason, now_s)

    def _hold(self, reason: str, now_s: float) -> None:
        self._active, self._pose, self._verges_on_sight = False, None, False
        self._seen.tracking.clear()
        self._seen.judge.restart(reason)
        self._law.reset()
        # Eyes in motion stop where they are, eyes at rest keep the command that brought them there.
        known = self._seen.history.known and self._command is not None
        moving = known and self._command is not None and not self._seen.eyes_still(now_s, self._command)
        self._rest = self._seen.history.reported_rad if moving else _UNKNOWN
        self._send_until_s = now_s + _HOLD_S
        self._phases.enter(Phase.IDLE, reason, now_s)

    def _report(self, now_s: float) -> GazeReport:
        return report_of(now_s, self._seen, self._phases, self._law.name, self._p.mode, self._rig)


def _driven(parameters: GazeParameters) -> npt.NDArray[np.bool_]:
    """Return which joints (3,) may move."""
    pans = {"both_eyes": (True, True), "left_held": (False, True), "right_held": (True, False)}[parameters.mode]
    return np.array([*pans, parameters.tilt_enabled])
