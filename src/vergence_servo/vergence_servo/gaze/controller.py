"""The gaze controller: observations in, joint commands out, one call a cycle. No ROS, no clock of its own."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_rig.rig import Rig
from vergence_servo.gaze.directions import spread_of_eye
from vergence_servo.gaze.distance import UNKNOWN, TargetPosition, joint_variances, target_position
from vergence_servo.gaze.frames import point_in_rig
from vergence_servo.gaze.goal_start import WantedClass, WantedPose, start_of
from vergence_servo.gaze.goal_watch import GoalWatch, Progress
from vergence_servo.gaze.goals import Goal, GoalError, Result
from vergence_servo.gaze.joint_history import JointHistory
from vergence_servo.gaze.judge import VergedJudge
from vergence_servo.gaze.laws import Contrast, LawView, make_law
from vergence_servo.gaze.limits import CommandLimits
from vergence_servo.gaze.observations import (
    BoxSighting,
    EdgeJudgement,
    EyeRotationReading,
    FoveaDisparity,
    JointReport,
    Observation,
    PointSighting,
    TrackSighting,
)
from vergence_servo.gaze.parameters import GazeParameters
from vergence_servo.gaze.phases import Phase, PhaseMachine, Situation
from vergence_servo.gaze.report import Command, GazeReport, disparity_px, fixation_of_joints, residual_of
from vergence_servo.gaze.search_pattern import Searcher
from vergence_servo.gaze.target_filter import TargetEstimate
from vergence_servo.gaze.tracking import SightingError, TargetTracking
from vergence_servo.gaze.vergence_offset import VergenceOffset, farthest_offset_rad

Array = npt.NDArray[np.float64]

_STILL_SPEED_RAD_S = 0.2
_ARRIVED_RAD = 0.004
_STEADY_VERGENCE_RAD = 0.005
_SWEEPING_RAD_S = 0.6
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
        self._history = JointHistory(rig)
        self._limits = CommandLimits(rig)
        self._shaft_variances = joint_variances(rig)
        self.vergence_offset = VergenceOffset(self._shaft_variances, farthest_offset_rad(rig))
        """What the visual encoder has told of the shafts."""
        self._goals = GoalWatch()
        self._enabled = True
        self._pose: Array | None = None
        self._rest = _UNKNOWN
        self._command: Array | None = None
        self._command_s = math.nan
        self._send_until_s = -math.inf
        self._image_s = -math.inf
        self._pair_s = math.nan
        self._beyond_limits = False
        self._contrast: Contrast | None = None
        self._set(parameters)
        self._active = self._verges_on_sight = parameters.start == "verge"

    def _set(self, parameters: GazeParameters) -> None:
        rig, self._p = self._rig, parameters
        self._tracking = TargetTracking(rig, parameters, self._history)
        self._judge = VergedJudge(parameters)
        self._phases = PhaseMachine(parameters)
        self._law = make_law(rig, parameters)
        self._searcher = Searcher(
            rig, parameters.tilt_enabled, parameters.prior_vergence_rad, parameters.search_dwell_s
        )
        self._lead_s = max(joint.servo.command_latency_s for _, joint in rig.joints.items()) + 0.5 * self._period_s
        held = {"both_eyes": (True, True), "left_held": (False, True), "right_held": (True, False)}[parameters.mode]
        self._driven = np.array([*held, parameters.tilt_enabled])

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
        return point_in_rig(point_m, frame, stamp_s, self._history, self._rig.baseline_m)

    def look_at(self, goal: Goal, now_s: float) -> int:
        """Begin a goal and return its id; the one in hand ends as PREEMPTED.

        A goal that cannot be begun also gets an id; its outcome comes with the next step.
        """
        goal_id = self._goals.number()
        try:
            if not self._enabled:
                raise GoalError(Result.INVALID, "the controller is disabled: enable it first")
            wanted = start_of(goal, self._rig, self._p, self._history, now_s)
        except GoalError as error:
            self._goals.refuse(goal_id, error.result, error.reason)
            return goal_id
        self._goals.end(Result.PREEMPTED, "a newer goal took its place", now_s)
        self._goals.begin(goal_id, goal, now_s, self._p)
        self._active, self._pose, self._verges_on_sight = True, None, False
        self._judge.restart()
        self._law.reset()
        self._searcher.stop()
        if isinstance(wanted, WantedPose):
            self._tracking.clear()
            self._pose = np.where(self._driven, wanted.joints_rad, np.nan)
        elif isinstance(wanted, WantedClass):
            self._tracking.want_class(now_s, wanted.class_name)
        else:
            self._tracking.want(now_s, wanted.stamp_s, wanted.angles_rad, wanted.covariance)
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
            self._tracking.clear()

    def step(self, now_s: float, observations: Iterable[Observation] = ()) -> Command:
        """Take what arrived since the last cycle and return what to command now.

        A clock that runs back by more than a second was set: the eyes hold still and everything begins anew.
        """
        if now_s < self._command_s - _CLOCK_JUMP_S:
            self._history.forget()
            self._image_s, self._contrast = -math.inf, None
            self._command_s = now_s
            self._begin_anew("the clock was set back", self._p, now_s)
        for observation in observations:
            self._observe(observation, now_s)
        if not self._history.known or not math.isfinite(now_s):
            return Command(None, self._report(now_s), self._goals.take_outcomes())
        sending = self._enabled and (self._active or now_s < self._send_until_s)
        if self._command is None or not sending:
            # Idle, somebody else may move the joints: begin from where they are.
            self._command, self._command_s = self._limits.nearest(self._history.reported_rad), now_s
        wanted = self._decide(now_s, self._command) if self._active else self._rest
        sent = self._limits.sent(wanted, self._command, now_s - self._command_s, self._history.reported_rad)
        self._note_limits(wanted)
        self._command, self._command_s = sent, max(now_s, self._command_s)
        self._watch_goal(now_s)
        return Command(sent if sending else None, self._report(now_s), self._goals.take_outcomes())

    def _observe(self, observation: Observation, now_s: float) -> None:
        if isinstance(observation, JointReport):
            if self._history.add(observation.stamp_s, observation.positions_rad) and self._tracking.note_motion():
                self.vergence_offset.moved(observation.stamp_s)
            return
        if not self._history.known or not observation.stamp_s <= now_s + _CLOCK_JUMP_S:
            return
        if isinstance(observation, EyeRotationReading):
            if observation.usable and self._tracking.eyes_were_still(observation.stamp_s, observation.skew_s):
                left, right, _ = self._history.shaft_at(observation.stamp_s)
                difference_rad = observation.vergence_rad - float(right - left)
                self.vergence_offset.see(observation.stamp_s, difference_rad, observation.sigma_rad)
            return
        if isinstance(observation, EdgeJudgement):
            self._image_s = now_s
            self._see_contrast(observation, now_s)
            return
        try:
            believed = self._see(observation, now_s)
        except SightingError as error:
            self._tracking.note = str(error)
            return
        if believed:
            self._pair_s = observation.stamp_s
            if not self._law.unsigned:
                self._judge_pair(observation.stamp_s, now_s)

    def _see(self, observation: Observation, now_s: float) -> bool:
        if isinstance(observation, PointSighting):
            if self._goals.goal_id is None and not self._tracking.takes_stream and self._enabled:
                self._tracking.want_stream(now_s)
                self._judge.restart("a target is given by its position")
                self._active, self._pose, self._verges_on_sight = True, None, False
            return self._tracking.see_point(observation, now_s)
        self._image_s = now_s
        if isinstance(observation, TrackSighting):
            return self._tracking.see_track(observation, now_s)
        if isinstance(observation, BoxSighting):
            return self._tracking.see_box(observation, now_s)
        return isinstance(observation, FoveaDisparity) and self._tracking.see_fovea(observation, now_s)

    def _see_contrast(self, seen: EdgeJudgement, now_s: float) -> None:
        self._judge.see_contrast(seen.stamp_s, seen.contrast, seen.verged)
        if not (math.isfinite(seen.stamp_s) and self._history.covers(seen.stamp_s)):
            return
        if self._contrast is not None and seen.stamp_s <= self._contrast.stamp_s:
            return
        joints = self._history.shaft_at(seen.stamp_s)
        resting = self._tracking.eyes_were_still(seen.stamp_s, 0.0)
        vergence = float(joints[1] - joints[0])
        self._contrast = Contrast(seen.stamp_s, seen.contrast, seen.metric_px, vergence, resting)
        if self._law.unsigned and resting and self._tracking.filter.initialised:
            self._judge.see_pair(seen.stamp_s, now_s, self._law.remaining_rad(), True, self._is_verging)

    @property
    def _is_verging(self) -> bool:
        return self._phases.phase in (Phase.VERGE, Phase.FIXATE)

    def _judge_pair(self, stamp_s: float, now_s: float) -> None:
        visual = self._tracking.visual
        if self._tracking.source == "point":
            stamp_s = self._judge.exposure_for(stamp_s, now_s)
        estimate = self._tracking.estimate(stamp_s)
        if visual is None or estimate is None:
            return
        joints = self._history.shaft_at(stamp_s)
        errors = estimate.joints_rad - joints if self._tracking.source == "point" else visual.error_rad
        # With an eye held there is no version to correct: what is left is vergence, and the tilt.
        judged = range(3) if self._driven[:2].all() else (2,)
        measured = [abs(float(errors[i])) for i in judged if self._driven[i]]
        vergence_error = estimate.vergence_rad - float(joints[1] - joints[0])
        error = max([abs(vergence_error), *(value for value in measured if math.isfinite(value))])
        # Eyes that sweep across the target are not verged on it; eyes that go along with it are.
        along = float(np.abs(estimate.rates_rad_s).max()) if estimate.moving else 0.0
        sweeping = self._history.speed_within(stamp_s - 0.03, stamp_s) > along + _SWEEPING_RAD_S
        certain = float(estimate.sigmas_rad[1]) < _STEADY_VERGENCE_RAD
        steady = certain and not sweeping and not self._tracking.doubtful
        self._judge.see_pair(stamp_s, now_s, error, steady, self._is_verging)

    def _decide(self, now_s: float, command: Array) -> Array:
        """Return the wanted joint angles (3,), NaN for joints that stay."""
        if self._pose is not None:
            self._phases.enter(Phase.SACCADE, "to the angles asked for", now_s)
            return self._pose
        if self._verges_on_sight and not self._tracking.filter.initialised:
            self._take_what_is_seen(now_s)
        phase = self._phases.advance(self._situation(self._view(now_s, command)))
        if phase is Phase.SEARCH:
            place = self._searcher.wanted(now_s, self._history.shaft_rad, self._limits.speed_rad_s)
            return np.where(self._driven, place, np.nan)
        self._searcher.stop()
        if phase in (Phase.LOST, Phase.IDLE):
            self._judge.restart("the target is lost")
            return _UNKNOWN
        if self._tracking.disagreement:
            self._phases.enter(Phase.VERGE, "estimators disagree: holding still", now_s)
            return _UNKNOWN
        return self._law.wanted(self._view(now_s, command))

    def _take_what_is_seen(self, now_s: float) -> None:
        self._phases.enter(Phase.VERGE, "verging on what the left eye looks at", now_s)
        left, right, tilt = self._history.shaft_rad
        spread = spread_of_eye(True, self._p.direction_sigma_rad, self._p.prior_vergence_sigma_rad)
        self._tracking.want(now_s, now_s, np.array([0.5 * (left + right), right - left, tilt]), spread)

    def _view(self, now_s: float, command: Array) -> LawView:
        return LawView(
            now_s=now_s,
            elapsed_s=max(now_s - self._command_s, 0.0),
            phase=self._phases.phase,
            target=self._tracking.filter,
            visual=self._tracking.visual,
            contrast=self._contrast,
            shaft_rad=self._history.shaft_rad,
            commanded_rad=command,
            driven=self._driven,
            speed_rad_s=self._limits.speed_rad_s,
            lead_s=self._lead_s,
        )

    def _situation(self, view: LawView) -> Situation:
        tracking, residual = self._tracking, np.zeros(3)
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
            unseen_s=self._unseen_s(view.now_s),
            residual_rad=float(np.abs(residual).max()),
            eyes_still=self._eyes_still(view.now_s, view.commanded_rad),
            travel_s=float((np.abs(residual) / view.speed_rad_s).max()),
            verged=self._judge.verged,
            may_search=tracking.class_name is not None or tracking.takes_stream or lost_s > self._p.search_after_s,
        )

    def _unseen_s(self, now_s: float) -> float:
        """Return for how long images came in which the target was not seen; inf before it ever was.

        While no image results come at all there is nothing to be lost in: a starved graph is late, not blind.
        """
        seen_s = self._tracking.seen_s
        if not math.isfinite(seen_s):
            return math.inf
        images_come = now_s - self._image_s < self._p.no_images_s
        return max(0.0, (self._image_s if images_come else now_s) - seen_s)

    def _eyes_still(self, now_s: float, command: Array) -> bool:
        slow = self._history.speed_within(self._history.newest_s - 0.015, now_s) < _STILL_SPEED_RAD_S
        return slow and bool((np.abs(self._history.reported_rad - command) < _ARRIVED_RAD).all())

    def _note_limits(self, wanted: Array) -> None:
        finite = np.isfinite(wanted)
        beyond = np.abs(wanted - self._limits.nearest(np.where(finite, wanted, 0.0)))[finite]
        self._beyond_limits = bool(beyond.size and beyond.max() > _LIMITED_RAD)

    def _watch_goal(self, now_s: float) -> None:
        if self._goals.goal_id is None or self._command is None:
            return
        pose_reached: bool | None = None
        if self._pose is not None:
            off = np.where(np.isfinite(self._pose), np.abs(self._pose - self._history.reported_rad), 0.0)
            pose_reached = bool(off.max() < _ARRIVED_RAD) and self._eyes_still(now_s, self._command)
        progress = Progress(
            now_s=now_s,
            verged=self._judge.verged,
            judged=self._judge.reason,
            note=self._tracking.note,
            phase=self._phases.phase,
            in_phase_s=now_s - self._phases.since_s,
            image_s=self._image_s,
            beyond_limits=self._beyond_limits,
            disagreement=self._tracking.disagreement,
            by_class=self._tracking.class_name is not None,
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
        self._tracking.clear()
        self._judge.restart(reason)
        self._law.reset()
        # Eyes in motion stop where they are, eyes at rest keep the command that brought them there.
        known = self._history.known and self._command is not None
        moving = known and self._command is not None and not self._eyes_still(now_s, self._command)
        self._rest = self._history.reported_rad if moving else _UNKNOWN
        self._send_until_s = now_s + _HOLD_S
        self._phases.enter(Phase.IDLE, reason, now_s)

    def _report(self, now_s: float) -> GazeReport:
        known = self._history.known and math.isfinite(now_s)
        joints = self._history.shaft_rad if known else _UNKNOWN
        estimate = self._tracking.estimate(now_s) if known else None
        residual = residual_of(estimate, joints)
        fixation, miss = fixation_of_joints(joints, self._rig.baseline_m)
        reason = self._phases.reason if known else "no joint_states have arrived"
        if self._phases.phase is Phase.VERGE and not self._judge.verged:
            reason = f"{reason}; {self._tracking.note or self._judge.reason}"
        return GazeReport(
            stamp_s=self._pair_s if math.isfinite(self._pair_s) else now_s,
            phase=self._phases.phase,
            reason=reason,
            law=self._law.name,
            mode=self._p.mode,
            verged=self._judge.verged,
            target_moving=self._tracking.filter.moving,
            version_rad=0.5 * float(joints[0] + joints[1]),
            vergence_rad=float(joints[1] - joints[0]),
            tilt_rad=float(joints[2]),
            residual_rad=residual,
            residual_px=disparity_px(residual[1], self._rig.left_camera.fx_px),
            contrast=self._judge.contrast,
            target=self._position(estimate),
            fixation_m=fixation,
            miss_distance_m=miss,
        )

    def _position(self, estimate: TargetEstimate | None) -> TargetPosition:
        return (
            UNKNOWN
            if estimate is None
            else target_position(estimate, self._rig, self._shaft_variances, self.vergence_offset)
        )
