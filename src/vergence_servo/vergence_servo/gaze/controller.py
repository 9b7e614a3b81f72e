"""The gaze controller: observations in, joint commands out, one call a cycle. No ROS, no clock of its own."""

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig
from vergence_servo.gaze.directions import spread_of_eye
from vergence_servo.gaze.distance import UNKNOWN, joint_variances, target_position
from vergence_servo.gaze.frames import point_in_rig
from vergence_servo.gaze.goal_start import WantedClass, WantedPose, start_of
from vergence_servo.gaze.goals import Goal, GoalError, Outcome, Result
from vergence_servo.gaze.joint_history import JointHistory
from vergence_servo.gaze.judge import VergedJudge
from vergence_servo.gaze.laws import LawView, make_law
from vergence_servo.gaze.limits import CommandLimits
from vergence_servo.gaze.observations import (
    BoxSighting,
    EdgeJudgement,
    FoveaDisparity,
    JointReport,
    Observation,
    PointSighting,
    TrackSighting,
)
from vergence_servo.gaze.parameters import GazeParameters
from vergence_servo.gaze.phases import Phase, PhaseMachine, Situation
from vergence_servo.gaze.report import Command, GazeReport, fixation_of_joints
from vergence_servo.gaze.search_pattern import SearchPattern
from vergence_servo.gaze.tracking import SightingError, TargetTracking

Array = npt.NDArray[np.float64]

_STILL_SPEED_RAD_S = 0.2
_ARRIVED_RAD = 0.004
_STEADY_VERGENCE_RAD = 0.005
_LIMITED_RAD = math.radians(1.0)
_LIMITED_S = 0.5
_LOST_S = 2.5
_DISAGREED_S = 1.0
_HOLD_S = 0.3


@dataclass
class _Pursued:
    """The goal in hand: what it is, since when, and since when something stands against it."""

    goal_id: int
    goal: Goal
    since_s: float
    limit_s: float
    limited_since_s: float = math.nan
    disagreed_since_s: float = math.nan


class GazeController:
    """Steers both eyes and the tilt onto a target and holds them there.

    Time is the caller's, in seconds; the stamps of observations are of the same clock.
    """

    def __init__(self, rig: Rig, parameters: GazeParameters, period_s: float = 0.01) -> None:
        self._rig, self._period_s = rig, period_s
        self._history = JointHistory(rig)
        self._limits = CommandLimits(rig)
        self._shaft_variances = joint_variances(rig)
        self._ids = itertools.count(1)
        self._pursued: _Pursued | None = None
        self._outcomes: list[Outcome] = []
        self._enabled = True
        self._active = False
        self._pose: Array | None = None
        self._command: Array | None = None
        self._command_s = math.nan
        self._send_until_s = -math.inf
        self._image_s = -math.inf
        self._newest_pair_s = math.nan
        self._metric_px = math.nan
        self._contrast_s = -math.inf
        self._set(parameters)
        self._active = self._verges_on_sight = parameters.start == "verge"

    def _set(self, parameters: GazeParameters) -> None:
        rig, self._p = self._rig, parameters
        self._tracking = TargetTracking(rig, parameters, self._history)
        self._judge = VergedJudge(parameters)
        self._phases = PhaseMachine(parameters)
        self._law = make_law(rig, parameters)
        self._lead_s = max(joint.servo.command_latency_s for _, joint in rig.joints.items()) + 0.5 * self._period_s
        held = {"both_eyes": (True, True), "left_held": (False, True), "right_held": (True, False)}[parameters.mode]
        self._driven = np.array([*held, parameters.tilt_enabled])
        self._search = SearchPattern(rig, parameters.tilt_enabled, parameters.prior_vergence_rad)
        self._search_place: tuple[float, float] | None = None
        self._search_until_s = -math.inf

    def set_parameters(self, parameters: GazeParameters, now_s: float) -> None:
        """Take other parameters: a goal in hand ends as CANCELLED and the eyes hold still."""
        self._end(Result.CANCELLED, "the parameters were changed", now_s)
        self._set(parameters)
        self._hold("the parameters were changed", now_s)

    def frame_to_rig(self, point_m: Any, frame: str, stamp_s: float) -> tuple[float, float, float]:
        """Return a point of a frame (see frames.FRAMES) in rig_base [m], with the joints as they were at `stamp_s`.

        Raises FrameError for a frame it does not know, or before any joint is known.
        """
        return point_in_rig(point_m, frame, stamp_s, self._history, self._rig.baseline_m)

    @property
    def enabled(self) -> bool:
        """False while commands are held back."""
        return self._enabled

    @property
    def goal_id(self) -> int | None:
        """The goal in hand, None if there is none."""
        return self._pursued.goal_id if self._pursued else None

    def look_at(self, goal: Goal, now_s: float) -> int:
        """Begin a goal and return its id; the one in hand ends as PREEMPTED. A goal that cannot be begun also gets
        an id, and its outcome comes with the next step.
        """
        goal_id = next(self._ids)
        try:
            if not self._enabled:
                raise GoalError(Result.INVALID, "the controller is disabled: enable it first")
            wanted = start_of(goal, self._rig, self._p, self._history, now_s)
        except GoalError as error:
            self._outcomes.append(Outcome(goal_id, error.result, error.reason, 0.0))
            return goal_id
        self._end(Result.PREEMPTED, "a newer goal took its place", now_s)
        self._pursued = _Pursued(goal_id, goal, now_s, goal.time_limit_s or self._p.time_limit_s)
        self._active, self._pose, self._verges_on_sight = True, None, False
        self._judge.restart()
        self._law.reset()
        if isinstance(wanted, WantedPose):
            self._tracking.clear()
            self._pose = np.where(self._driven, wanted.joints_rad, np.nan)
        elif isinstance(wanted, WantedClass):
            self._tracking.want_class(now_s, wanted.class_name)
        else:
            self._tracking.want(now_s, wanted.stamp_s, wanted.angles_rad, wanted.covariance)
        self._search_place = None
        self._phases.enter(Phase.VERGE, "new goal", now_s)
        return goal_id

    def cancel(self, now_s: float, goal_id: int | None = None) -> bool:
        """End the goal in hand (or only if it is `goal_id`) as CANCELLED and hold still; False if there is none."""
        if self._pursued is None or goal_id not in (None, self._pursued.goal_id):
            return False
        self._end(Result.CANCELLED, "cancelled", now_s)
        self._hold("cancelled", now_s)
        return True

    def stop(self, now_s: float) -> None:
        """End any goal and hold still where the eyes are."""
        self._end(Result.CANCELLED, "stopped", now_s)
        self._hold("stopped", now_s)

    def enable(self, enabled: bool, now_s: float) -> None:
        """Disable: hold still and send nothing. Enable: without a goal, verge on what the eyes see."""
        self._enabled = enabled
        if not enabled:
            self._end(Result.CANCELLED, "disabled", now_s)
            self._hold("disabled", now_s)
            self._send_until_s = -math.inf
        elif not self._active:
            self._active = self._verges_on_sight = True
            self._tracking.clear()

    def step(self, now_s: float, observations: Iterable[Observation] = ()) -> Command:
        """Take what arrived since the last cycle and return what to command now."""
        for observation in observations:
            self._observe(observation, now_s)
        if not self._history.known or not math.isfinite(now_s):
            return self._finish(now_s, None)
        present = self._history.shaft_rad
        if self._command is None or not (self._active or now_s < self._send_until_s):
            # Idle, somebody else may move the joints: begin from where they are.
            self._command = self._limits.nearest(self._history.reported_rad)
            self._command_s = now_s
        self._tracking.note_motion()
        if self._active and self._verges_on_sight and self._pursued is None:
            self._take_what_is_seen(now_s)
        view = self._view(now_s, present)
        wanted = self._decide(view, now_s) if self._active else np.full(3, np.nan)
        sending = self._enabled and (self._active or now_s < self._send_until_s)
        sent = self._limits.sent(wanted, self._command, now_s - self._command_s, self._history.reported_rad)
        self._note_limits(wanted, now_s)
        if now_s > self._command_s:
            self._command_s = now_s
        self._command = sent
        self._watch_goal(now_s)
        return self._finish(now_s, sent if sending else None)

    def _observe(self, observation: Observation, now_s: float) -> None:
        if isinstance(observation, JointReport):
            self._history.add(observation.stamp_s, observation.positions_rad)
            return
        if not self._history.known or not observation.stamp_s <= now_s + 1.0:
            return
        if isinstance(observation, EdgeJudgement):
            self._judge.see_contrast(observation.stamp_s, observation.contrast, observation.verged)
            self._metric_px, self._contrast_s = observation.metric_px, observation.stamp_s
            self._image_s = now_s
            return
        try:
            believed = self._see(observation, now_s)
        except SightingError as error:
            self._tracking.note = str(error)
            return
        if believed:
            self._newest_pair_s = observation.stamp_s
            self._judge_pair(observation.stamp_s, now_s)

    def _see(self, observation: Observation, now_s: float) -> bool:
        if isinstance(observation, PointSighting):
            if self._pursued is None and not self._tracking.takes_stream and self._enabled:
                self._tracking.want_stream(now_s)
                self._judge.restart("a target is given by its position")
                self._active, self._pose, self._verges_on_sight = True, None, False
            return self._tracking.see_point(observation, now_s)
        self._image_s = now_s
        if isinstance(observation, TrackSighting):
            return self._tracking.see_track(observation, now_s)
        if isinstance(observation, BoxSighting):
            return self._tracking.see_box(observation, now_s)
        if isinstance(observation, FoveaDisparity):
            return self._tracking.see_fovea(observation, now_s)
        return False

    def _judge_pair(self, stamp_s: float, now_s: float) -> None:
        visual, estimate = self._tracking.visual, self._tracking.estimate(stamp_s)
        if visual is None or estimate is None:
            return
        errors = visual.error_rad
        vergence_error = float(estimate.vergence_rad - np.diff(self._history.shaft_at(stamp_s)[:2])[0])
        measured = [abs(float(errors[i])) for i in range(3) if self._driven[i] and math.isfinite(errors[i])]
        error = max([abs(vergence_error) if self._driven[:2].all() else 0.0, *measured])
        steady = float(estimate.sigmas_rad[1]) < _STEADY_VERGENCE_RAD and not self._tracking.doubtful
        self._judge.see_pair(stamp_s, now_s, error, steady, self._phases.phase in (Phase.VERGE, Phase.FIXATE))

    def _take_what_is_seen(self, now_s: float) -> None:
        if self._tracking.filter.initialised:
            return
        if self._phases.phase is Phase.IDLE:
            self._phases.enter(Phase.VERGE, "verging on what the left eye looks at", now_s)
        joints = self._history.shaft_rad
        vergence = float(joints[1] - joints[0])
        version = 0.5 * float(joints[0] + joints[1])
        spread = spread_of_eye(True, self._p.direction_sigma_rad, self._p.prior_vergence_sigma_rad)
        self._tracking.want(now_s, now_s, np.array([version, vergence, float(joints[2])]), spread)

    def _view(self, now_s: float, shaft_rad: Array) -> LawView:
        assert self._command is not None
        return LawView(
            now_s=now_s,
            elapsed_s=now_s - self._command_s,
            phase=self._phases.phase,
            target=self._tracking.filter,
            visual=self._tracking.visual,
            contrast=self._judge.contrast,
            metric_px=self._metric_px,
            contrast_s=self._contrast_s,
            shaft_rad=shaft_rad,
            commanded_rad=self._command,
            driven=self._driven,
            speed_rad_s=self._limits.speed_rad_s,
            lead_s=self._lead_s,
            minimum_vergence_rad=self._limits.minimum_vergence_rad,
        )

    def _decide(self, view: LawView, now_s: float) -> Array:
        """Return the wanted joint angles (3,), NaN for joints that stay."""
        if self._pose is not None:
            self._phases.enter(Phase.SACCADE, "to the angles asked for", now_s)
            return self._pose
        has_target = self._tracking.filter.initialised
        residual = self._law.residual(view) if has_target else np.full(3, math.nan)
        travel = np.abs(residual) / view.speed_rad_s
        seen_s = self._tracking.seen_s
        situation = Situation(
            now_s=now_s,
            active=self._active,
            has_target=has_target,
            unseen_s=now_s - seen_s if math.isfinite(seen_s) else math.inf,
            residual_rad=float(np.abs(self._within_limits(residual, view)).max()) if has_target else math.nan,
            eyes_still=self._eyes_still(now_s),
            travel_s=float(np.nan_to_num(travel).max()),
            verged=self._judge.verged,
            may_search=self._tracking.class_name is not None
            or self._tracking.takes_stream
            or self._judge_was_lost(now_s),
        )
        phase = self._phases.advance(situation)
        if phase is Phase.SEARCH:
            return self._search_wanted(view, now_s)
        self._search_place = None
        if phase in (Phase.LOST, Phase.IDLE):
            self._judge.restart("target lost")
            return np.full(3, np.nan)
        if self._tracking.disagreement:
            self._phases.enter(Phase.VERGE, "estimators disagree: holding still", now_s)
            return np.full(3, np.nan)
        return self._law.wanted(self._view(now_s, view.shaft_rad))

    def _judge_was_lost(self, now_s: float) -> bool:
        return self._phases.phase is Phase.LOST and now_s - self._phases.since_s > self._p.search_after_s

    def _within_limits(self, residual: Array, view: LawView) -> Array:
        """A target out of reach leaves no residual that turning could still mend."""
        reachable = self._limits.nearest(view.shaft_rad + residual)
        within: Array = np.where(self._driven, reachable - view.shaft_rad, 0.0)
        return within

    def _search_wanted(self, view: LawView, now_s: float) -> Array:
        shaft = view.shaft_rad
        if self._search_place is None or (now_s > self._search_until_s):
            if self._search_place is None:
                self._search = SearchPattern(self._rig, self._p.tilt_enabled, self._p.prior_vergence_rad)
            place = self._search.next(0.5 * float(shaft[0] + shaft[1]), float(shaft[2]))
            travel_s = max(
                abs(place[0] - 0.5 * float(shaft[0] + shaft[1])) / float(view.speed_rad_s[0]),
                abs(np.nan_to_num(place[1]) - float(shaft[2])) / float(view.speed_rad_s[2]),
            )
            self._search_place = place
            self._search_until_s = now_s + travel_s + self._p.search_dwell_s
        version, tilt = self._search_place
        half = 0.5 * self._p.prior_vergence_rad
        return np.where(self._driven, np.array([version - half, version + half, tilt]), np.nan)

    def _eyes_still(self, now_s: float) -> bool:
        assert self._command is not None
        reported = self._history.reported_rad
        slow = self._history.speed_within(self._history.newest_s - 0.015, now_s) < _STILL_SPEED_RAD_S
        return slow and bool((np.abs(reported - self._command) < _ARRIVED_RAD).all())

    def _note_limits(self, wanted: Array, now_s: float) -> None:
        if self._pursued is None or self._pose is not None:
            return
        finite = np.isfinite(wanted)
        beyond = np.abs(wanted - self._limits.nearest(np.where(finite, wanted, 0.0)))[finite]
        if beyond.size and beyond.max() > _LIMITED_RAD:
            if math.isnan(self._pursued.limited_since_s):
                self._pursued.limited_since_s = now_s
        else:
            self._pursued.limited_since_s = math.nan

    def _watch_goal(self, now_s: float) -> None:
        """End the goal in hand if it is reached or can no longer be."""
        pursued = self._pursued
        if pursued is None:
            return
        age_s = now_s - pursued.since_s
        disagrees = self._tracking.disagreement
        if not disagrees:
            pursued.disagreed_since_s = math.nan
        elif math.isnan(pursued.disagreed_since_s):
            pursued.disagreed_since_s = now_s
        phase, in_phase_s = self._phases.phase, now_s - self._phases.since_s
        if self._pose is not None:
            if age_s > 0.02 and self._eyes_still(now_s) and self._arrived(self._pose):
                self._end(Result.VERGED, "the angles are reached", now_s)
                self._hold("at the angles asked for", now_s)
            elif age_s > pursued.limit_s:
                self._end(Result.TIMED_OUT, "the joints did not arrive", now_s)
            return
        if self._judge.verged:
            self._end(Result.VERGED, self._judge.reason, now_s)
        elif now_s - pursued.limited_since_s > _LIMITED_S:
            self._end(Result.LIMITS, "the target is beyond the joints' limits", now_s)
        elif now_s - pursued.disagreed_since_s > _DISAGREED_S:
            self._end(Result.DISAGREEMENT, "estimators disagree by more than the object's depth explains", now_s)
        elif now_s - max(self._image_s, pursued.since_s) > self._p.no_images_s:
            self._end(Result.NO_IMAGES, "no image results arrive", now_s)
        elif age_s > pursued.limit_s:
            lost = phase in (Phase.LOST, Phase.SEARCH)
            self._end(Result.LOST if lost else Result.TIMED_OUT, self._tracking.note or self._judge.reason, now_s)
        elif phase is Phase.SEARCH and self._tracking.class_name is None and in_phase_s > _LOST_S:
            self._end(Result.LOST, "the target was not found again", now_s)

    def _arrived(self, pose: Array) -> bool:
        reported = self._history.reported_rad
        return bool((np.abs(np.where(np.isfinite(pose), pose, reported) - reported) < _ARRIVED_RAD).all())

    def _end(self, result: Result, reason: str, now_s: float) -> None:
        if self._pursued is not None:
            age_s = now_s - self._pursued.since_s
            self._outcomes.append(Outcome(self._pursued.goal_id, result, reason, age_s))
            self._pursued = None

    def _hold(self, reason: str, now_s: float) -> None:
        self._active, self._pose, self._verges_on_sight = False, None, False
        self._tracking.clear()
        self._judge.restart(reason)
        self._law.reset()
        if self._history.known and self._command is not None and not self._eyes_still(now_s):
            self._command = self._limits.nearest(self._history.reported_rad)
        self._send_until_s = now_s + _HOLD_S
        self._phases.enter(Phase.IDLE, reason, now_s)

    def _finish(self, now_s: float, joints_rad: Array | None) -> Command:
        outcomes, self._outcomes = tuple(self._outcomes), []
        return Command(joints_rad, self._report(now_s), outcomes)

    def _report(self, now_s: float) -> GazeReport:
        nowhere = math.nan
        stamp_s = self._newest_pair_s if math.isfinite(self._newest_pair_s) else now_s
        if not self._history.known or not math.isfinite(now_s):
            joints, fixation, miss = np.full(3, nowhere), np.full(3, nowhere), nowhere
        else:
            joints = self._history.shaft_rad
            fixation, miss = fixation_of_joints(joints, self._rig.baseline_m)
        version, vergence = 0.5 * float(joints[0] + joints[1]), float(joints[1] - joints[0])
        estimate = self._tracking.estimate(now_s) if math.isfinite(now_s) else None
        residual, residual_px, position = (nowhere, nowhere, nowhere), nowhere, UNKNOWN
        if estimate is not None:
            residual = (
                estimate.version_rad - version,
                estimate.vergence_rad - vergence,
                estimate.tilt_rad - float(joints[2]),
            )
            residual_px = self._rig.left_camera.fx_px * math.tan(max(min(residual[1], 1.5), -1.5))
            position = target_position(estimate, self._rig, self._shaft_variances)
        reason = self._phases.reason if self._history.known else "no joint_states have arrived"
        if self._phases.phase is Phase.VERGE and not self._judge.verged:
            reason = f"{reason}; {self._tracking.note or self._judge.reason}"
        return GazeReport(
            stamp_s=stamp_s,
            phase=self._phases.phase,
            reason=reason,
            law=self._law.name,
            mode=self._p.mode,
            verged=self._judge.verged,
            target_moving=self._tracking.filter.moving,
            version_rad=version,
            vergence_rad=vergence,
            tilt_rad=float(joints[2]),
            residual_rad=residual,
            residual_px=residual_px,
            contrast=self._judge.contrast,
            target=position,
            fixation_m=fixation,
            miss_distance_m=miss,
        )
