"""The gaze controller: observations in, joint commands out, one call a cycle. No ROS, no clock of its own."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_gaze.attention.attending import Attending
from vergence_gaze.attention_parameters import DISABLED
from vergence_gaze.control.perception import LATEST_FUTURE_S, Perception
from vergence_gaze.control.report import Command, GazeReport, make_report
from vergence_gaze.control.search_pattern import Searcher, SearchPattern
from vergence_gaze.control.situations import progress_of, situation_of
from vergence_gaze.control.track_requests import TrackRequests
from vergence_gaze.estimation.mount_drift import MountDrift
from vergence_gaze.estimation.observations import (
    BoxSighting,
    JointReport,
    JointResolution,
    Observation,
    PointSighting,
)
from vergence_gaze.estimation.vergence_offset import VergenceOffset
from vergence_gaze.goals.goal import Goal, GoalError, GoalKind, ObjectRequest, Result, TrackRequest
from vergence_gaze.goals.goal_monitor import GoalMonitor
from vergence_gaze.goals.goal_pace import pace
from vergence_gaze.goals.goal_resolution import ClassRequest, MotionRequest, Request, RequestedPose, resolve_goal
from vergence_gaze.joints.feedback import FeedbackMonitor
from vergence_gaze.joints.frames import point_in_rig
from vergence_gaze.joints.joint_reports import in_eye_angles
from vergence_gaze.joints.limits import CommandLimits
from vergence_gaze.joints.resolution import pulse_steps_rad, rig_with_steps
from vergence_gaze.laws import make_law
from vergence_gaze.laws.protocol import ControlInput
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase, PhaseMachine, Situation
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_LIMITED_RAD = math.radians(1.0)
_HOLD_S = 0.3
_CLOCK_JUMP_S = 1.0
_UNKNOWN = np.full(3, np.nan)


class GazeController:
    """Steers both eyes and the tilt onto a target and holds them there.

    Time is the caller's, in seconds; the stamps of observations are of the same clock. Joint reports and commands are
    of the joints; everything inside, and every goal and report, is in eye angles (see `vergence_rig.kinematics`).
    """

    def __init__(self, rig: Rig, parameters: GazeParameters, period_s: float = 0.01) -> None:
        self._given, self._described, self._period_s = rig, rig, period_s
        self._rig = rig = rig.in_eye_angles()
        self._limits = CommandLimits(rig)
        self._goals = GoalMonitor()
        self._enabled = True
        self._pose: Array | None = None
        self._rest = _UNKNOWN
        self._command: Array | None = None
        self._command_s = math.nan
        self._send_until_s = -math.inf
        self._beyond_limits = False
        self._goal_speed_rad_s = math.inf
        self._feedback = FeedbackMonitor()
        self._perception = Perception(rig, parameters, _driven(parameters))
        self._attention = Attending(rig, parameters)
        self._configure(parameters)
        self._active = self._verges_on_sight = parameters.control.start == "verge"

    def _configure(self, parameters: GazeParameters) -> None:
        rig, self._p = self._rig, parameters
        self._driven = _driven(parameters)
        self._perception.configure(parameters, self._driven)
        self._phases = PhaseMachine(parameters)
        self._requests = TrackRequests(self._perception, parameters)
        self._law = make_law(rig, parameters)
        self._attention.configure(rig, parameters)
        tilts, vergence_rad = parameters.control.tilt_enabled, parameters.target.prior_vergence_rad
        self._searcher = Searcher(
            lambda: SearchPattern(rig, tilts, vergence_rad), vergence_rad, parameters.search.dwell_s
        )
        self._lead_s = max(joint.servo.command_latency_s for _, joint in rig.joints.items()) + 0.5 * self._period_s

    @property
    def vergence_offset(self) -> VergenceOffset:
        """The true vergence relative to the shafts' estimate, by the visual encoder."""
        return self._perception.vergence_offset

    @property
    def mounts(self) -> MountDrift:
        """How far the mounts have moved since the head was described, by the visual encoder."""
        return self._perception.mounts

    @property
    def resolution_rad(self) -> Array:
        """The smallest step of each joint (3,) [rad]: its driver's, or else the one that the rig describes."""
        return pulse_steps_rad(self._described)

    @property
    def uses_images(self) -> bool:
        """True while what the images show turns the eyes, or may: not while they hold still or go to an angle."""
        return (self._active and self._pose is None) or self._attention.policy != DISABLED

    @property
    def kinematics(self) -> Kinematics:
        """Those of the head as it is described now."""
        return self._perception.kinematics

    @property
    def goal_id(self) -> int | None:
        """The active goal, None if there is none."""
        return self._goals.goal_id

    def set_parameters(self, parameters: GazeParameters, now_s: float) -> None:
        """Apply other parameters: the active goal ends as CANCELLED and the eyes hold still."""
        self._restart("the parameters were changed", parameters, now_s)

    def frame_to_rig(self, point_m: Any, frame: str, stamp_s: float) -> tuple[float, float, float]:
        """Return a point of a frame (see frames.FRAMES) in rig_base [m], with the joints as they were at `stamp_s`.

        Raises FrameError for an unknown frame, or before any joint is known.
        """
        return point_in_rig(point_m, frame, stamp_s, self._perception.history, self._perception.kinematics)

    def check(self, goal: Goal, now_s: float) -> None:
        """Raise GoalError for a goal that cannot be started now; nothing changes."""
        self._resolved(goal, now_s)

    def look_at(self, goal: Goal, now_s: float) -> int:
        """Start a goal and return its id; the active one ends as PREEMPTED.

        A goal that cannot be started also gets an id; its outcome comes with the next step.
        """
        goal_id = self._goals.new_id()
        try:
            request = self._resolved(goal, now_s)
        except GoalError as error:
            self._goals.reject(goal_id, error.result, error.reason)
            return goal_id
        self._goals.end(Result.PREEMPTED, "preempted by a newer goal", now_s)
        speeds = self._limits.speed_rad_s
        self._goal_speed_rad_s, slow_s = pace(goal, request, self._perception.history, self._driven, speeds)
        self._goals.start(goal_id, goal, now_s, self._p, slow_s)
        self._feedback.retry()
        self._activate(now_s)
        self._perception.judge.restart()
        self._law.reset()
        self._searcher.stop()
        tracking = self._perception.tracking
        self._free_requests()
        if isinstance(request, RequestedPose):
            tracking.clear()
            self._pose = np.where(self._driven, request.joints_rad, np.nan)
        elif isinstance(request, ClassRequest):
            tracking.request_class(request.class_name, goal_id)
            self._requests.ask_object(ObjectRequest(request.class_name))
        elif isinstance(request, MotionRequest):
            tracking.request_motion(goal_id)
            self._requests.ask(TrackRequest(goal_id, motion=True))
        else:
            start = now_s, request.stamp_s, request.angles_rad, request.covariance, goal_id
            if goal.kind is GoalKind.POINT:
                tracking.request_point(*start)
            else:
                tracking.request_target(*start)
                xy = goal.left_xy if goal.left_eye else goal.right_xy
                self._requests.ask(TrackRequest(goal_id, request.stamp_s, goal.left_eye, xy, goal.extent_rad))
        self._phases.enter(Phase.VERGE, "new goal", now_s)
        return goal_id

    def _resolved(self, goal: Goal, now_s: float) -> Request:
        if not self._enabled:
            raise GoalError(Result.INVALID, "the controller must be enabled: it is disabled")
        kinematics, history = self._perception.kinematics, self._perception.history
        return resolve_goal(goal, self._rig, kinematics, self._p, history, now_s, self._feedback.fault)

    @property
    def _speed_rad_s(self) -> Array:
        """The largest speeds of the joints (3,) now: their own, or the active goal's."""
        own_rad_s = self._present_limits.speed_rad_s
        return own_rad_s if self._goals.goal_id is None else np.minimum(own_rad_s, self._goal_speed_rad_s)

    def cancel(self, now_s: float, goal_id: int | None = None) -> bool:
        """End the active goal (or only if it is `goal_id`) as CANCELLED and hold still; False if there is none."""
        if self._goals.goal_id is None or goal_id not in (None, self._goals.goal_id):
            return False
        self._goals.end(Result.CANCELLED, "the goal was cancelled", now_s)
        self._hold("the goal was cancelled", now_s)
        return True

    def stop(self, now_s: float) -> None:
        """End any goal and hold still where the eyes are."""
        self._goals.end(Result.CANCELLED, "stopped on request", now_s)
        self._attention.pause()
        self._hold("stopped on request", now_s)

    def set_attention(self, policy: str, now_s: float) -> None:
        """Set the policy of attention without a goal, one of attention_parameters.POLICIES; it ends a stop."""
        engaged = self._attention.engaged
        self._attention.set_policy(policy)
        if engaged and not self._attention.engaged:
            self._hold("attention is disabled", now_s)

    def enable(self, enabled: bool, now_s: float) -> None:
        """Disable: hold still and send nothing. Enable: without a goal, attend, or verge on what the left eye sees."""
        self._enabled = enabled
        if not enabled:
            self._goals.end(Result.CANCELLED, "disabled: the eyes hold still, no commands are sent", now_s)
            self._hold("disabled: the eyes hold still, no commands are sent", now_s)
            self._send_until_s = -math.inf
        elif self._attention.policy != DISABLED:
            self._attention.resume()
        elif not self._active:
            self._activate(now_s)
            self._verges_on_sight = True
            self._perception.tracking.clear()
            self._free_requests()

    def step(self, now_s: float, observations: Iterable[Observation] = (), joint_fault: str = "") -> Command:
        """Update by what arrived since the last cycle and return what to command now.

        `joint_fault` says why no usable joint_states arrive, as whoever reads them reports it; empty while they do.
        """
        self.observe(observations, now_s)
        sending = self._enabled and (self._active or now_s < self._send_until_s)
        last_sent, history = (self._command if sending else None), self._perception.history
        if not math.isfinite(now_s):
            return Command(None, self._report(now_s), self._goals.pop_outcomes())
        fault = self._feedback.update(now_s, history, last_sent, self._driven, joint_fault)
        self._goals.update_feedback(fault, now_s, self._p)
        if not history.known:
            return Command(None, self._report(now_s), self._goals.pop_outcomes())
        command = self._command
        if command is None or not sending:
            command = self._start_from_joints(now_s)
        if not self._fault(now_s):
            self._attend(now_s)
        desired = self._decide(now_s, command) if self._active else self._rest
        elapsed_s = now_s - self._command_s
        sent = self._present_limits.limited(desired, command, elapsed_s, history.reported_rad, self._speed_rad_s)
        self._note_limits(desired)
        self._command, self._command_s = sent, max(now_s, self._command_s)
        if sending:
            self._perception.history.on_command(now_s, sent)
        if not fault:
            self._update_goal(now_s)
        joints_rad = np.array(self._described.joint_angles(sent.tolist())) if sending else None
        outcomes, requests = self._goals.pop_outcomes(), self._requests
        return Command(joints_rad, self._report(now_s), outcomes, requests.pop(), requests.pop_object())

    def rests(self, now_s: float) -> bool:
        """Return whether a step would command nothing and end no goal: `observe` is then enough in most cycles."""
        busy = self._active or now_s < self._send_until_s or self._goals.has_outcomes
        return not busy and self._attention.policy == DISABLED

    def observe(self, observations: Iterable[Observation], now_s: float) -> None:
        """Update by what has arrived, as `step` does.

        If the clock runs back by more than a second, the eyes hold still and everything starts again.
        """
        if now_s < self._command_s - _CLOCK_JUMP_S:
            self._perception.on_clock_reset()
            self._feedback.clear()
            self._attention.restart()
            self._command_s = now_s
            self._restart("the clock was set back", self._p, now_s)
        for observation in observations:
            self._observe(observation, now_s)
        if self._perception.history.known and self.rests(now_s):
            self._start_from_joints(now_s)

    def _start_from_joints(self, now_s: float) -> Array:
        """Start the next command from where the joints are (3,): while none is sent, others may move them."""
        self._command = command = self._limits.nearest(self._perception.history.reported_rad)
        self._command_s = now_s
        return command

    @property
    def _present_limits(self) -> CommandLimits:
        return self._attention.limits if self._attention.engaged else self._limits

    def _attend(self, now_s: float) -> None:
        """Look at what attention wants while nothing else is asked for."""
        tracking, attention = self._perception.tracking, self._attention
        streams = tracking.follows_stream and self._perception.unseen_s(now_s) <= self._p.target.lost_after_s
        asked = streams or self._goals.goal_id is not None
        searching = self._phases.phase is Phase.SEARCH
        if not attention.update(now_s, asked, searching, self._enabled, self._perception.judge.verged):
            return
        self._activate(now_s)
        focus = attention.focus
        if focus is None:
            tracking.clear()
            self._free_requests()
            self._phases.enter(Phase.LOST, attention.describe(), now_s)
        else:
            self._requests.ask_object(ObjectRequest(focus.class_name, focus.object_id))
            if tracking.class_name != focus.class_name or focus.object_id not in (0, tracking.object_id):
                self._turn_to(focus.class_name, focus.object_id, focus.reason, now_s)

    def _turn_to(self, class_name: str, object_id: int, reason: str, now_s: float) -> None:
        """Start again with an object of a class, this one if an id is given, on behalf of the same goal or of none."""
        self._perception.tracking.request_class(class_name, self._goals.new_id(), object_id)
        self._requests.free()
        self._perception.judge.restart(reason)
        self._law.reset()
        self._phases.enter(Phase.VERGE, reason, now_s)

    def _free_requests(self) -> None:
        self._requests.free()
        self._requests.ask_object(ObjectRequest())

    def _observe(self, observation: Observation, now_s: float) -> None:
        if isinstance(observation, JointResolution):
            self._set_steps(observation)
            return
        if isinstance(observation, JointReport):
            observation = in_eye_angles(observation, self._described)
        known = self._perception.history.known and observation.stamp_s <= now_s + LATEST_FUTURE_S
        if isinstance(observation, BoxSighting):
            self._attention.observe(observation, now_s)
            if known and self._perception.tracking.is_another(observation):
                reason = f"object {observation.object_id} is the target now"
                self._turn_to(self._perception.tracking.class_name or "", 0, reason, now_s)
        if isinstance(observation, PointSighting) and known and self._goals.goal_id is None and self._enabled:
            self._follow_stream(now_s)
        verging = self._phases.phase in (Phase.VERGE, Phase.FIXATE)
        self._perception.update(observation, now_s, self._law, verging)
        if self._perception.mounts_corrected:
            self._perception.mounts_corrected = False
            self._describe(self.mounts.corrected(self._given))

    def _set_steps(self, resolution: JointResolution) -> None:
        self._given = rig_with_steps(self._given, resolution.steps_rad)
        self._describe(self.mounts.corrected(self._given))

    def _describe(self, rig: Rig) -> None:
        """Use another description of the head: other steps of its servos, or mounts found to have moved."""
        if rig == self._described:
            return
        if self._command is not None:
            self._command = np.array(rig.eye_angles(self._described.joint_angles(self._command.tolist())))
        self._described, self._rig = rig, rig.in_eye_angles()
        self._limits = CommandLimits(self._rig)
        self._attention.set_rig(self._rig)
        self._perception.set_rig(self._rig)
        self._law = make_law(self._rig, self._p)

    def _follow_stream(self, now_s: float) -> None:
        if not self._perception.tracking.follows_stream:
            self._perception.tracking.request_stream()
            self._free_requests()
            self._perception.judge.restart("the target is a stream of points")
            self._activate(now_s)

    def _decide(self, now_s: float, command: Array) -> Array:
        """Return the desired joint angles (3,), NaN for joints that stay."""
        if self._feedback.fault:
            return self._wait(now_s)
        if self._pose is not None:
            self._phases.enter(Phase.SACCADE, "turning to the requested angles", now_s)
            return self._pose
        if images_fault := self._perception.images_fault(now_s):
            self._perception.judge.restart(images_fault)
            if not self._perception.tracking.follows_stream:
                return self._wait(now_s)
        unseen = not self._perception.unseen_s(now_s) <= self._p.target.lost_after_s
        if self._verges_on_sight and unseen and self._requests.ask_for_view(self._goals.new_id(), now_s):
            self._phases.enter(Phase.VERGE, "no goal: verging on what the left eye looks at", now_s)
        situation = self._situation(self._control_input(now_s, command))
        phase = self._phases.update(situation)
        resting = situation.eyes_still and situation.residual_rad <= self._p.saccade.threshold_rad
        self._requests.ask_at_point(resting, now_s)
        if phase is Phase.SEARCH:
            shaft_rad = self._perception.history.shaft_rad
            if self._attention.engaged:
                place = self._attention.next_pose(now_s, shaft_rad)
            else:
                place = self._searcher.next_pose(now_s, shaft_rad, self._speed_rad_s)
            return np.where(self._driven, place, np.nan)
        self._stop_searching()
        if phase in (Phase.LOST, Phase.IDLE):
            self._perception.judge.restart("the target is lost")
            return _UNKNOWN
        if phase is Phase.SACCADE and self._perception.judge.verged:
            self._perception.judge.restart("a saccade to the target is under way")
        return self._law.compute_command(self._control_input(now_s, command))

    def _fault(self, now_s: float) -> str:
        """Return what is wrong with the joints' feedback, or else with the images; "" if nothing is."""
        return self._feedback.fault or self._perception.images_fault(now_s)

    def _wait(self, now_s: float) -> Array:
        """Let the joints stay where they were sent: during a fault nothing is searched, pursued or verged on."""
        fault = self._fault(now_s)
        self._stop_searching()
        self._law.reset()
        self._perception.judge.restart(fault)
        self._phases.enter(Phase.LOST, fault, now_s)
        return _UNKNOWN

    def _stop_searching(self) -> None:
        self._searcher.stop()
        self._attention.stop_searching()

    def _control_input(self, now_s: float, command: Array) -> ControlInput:
        return ControlInput(
            now_s=now_s,
            elapsed_s=max(now_s - self._command_s, 0.0),
            phase=self._phases.phase,
            target=self._perception.tracking.filter,
            visual=self._perception.tracking.visual,
            contrast=self._perception.contrast,
            shaft_rad=self._perception.history.shaft_rad,
            commanded_rad=command,
            driven=self._driven,
            speed_rad_s=self._speed_rad_s,
            lead_s=self._lead_s,
            half_play_rad=self._perception.history.half_play_rad,
        )

    def _situation(self, state: ControlInput) -> Situation:
        return situation_of(
            state,
            self._perception,
            self._phases,
            self._law,
            self._limits,
            self._p,
            active=self._active,
            attends_and_may_search=self._attention.may_search if self._attention.engaged else None,
        )

    def _note_limits(self, desired: Array) -> None:
        finite = np.isfinite(desired)
        beyond = np.abs(desired - self._limits.nearest(np.where(finite, desired, 0.0)))[finite]
        self._beyond_limits = bool(beyond.size and beyond.max() > _LIMITED_RAD)

    def _update_goal(self, now_s: float) -> None:
        if self._goals.goal_id is None or self._command is None:
            return
        pose_reached: bool | None = None
        if self._pose is not None:
            pose_reached = self._perception.reached(self._pose) and self._perception.eyes_still(now_s, self._command)
        progress = progress_of(now_s, self._perception, self._phases, pose_reached, self._beyond_limits)
        if self._goals.update(progress, self._p) is Result.VERGED and pose_reached:
            self._hold("the joints are at the requested angles", now_s)

    def _restart(self, reason: str, parameters: GazeParameters, now_s: float) -> None:
        self._goals.end(Result.CANCELLED, reason, now_s)
        self._configure(parameters)
        self._hold(reason, now_s)

    def _activate(self, now_s: float) -> None:
        self._active, self._pose, self._verges_on_sight = True, None, False
        self._perception.expect_images(now_s)

    def _hold(self, reason: str, now_s: float) -> None:
        self._active, self._pose, self._verges_on_sight = False, None, False
        self._perception.tracking.clear()
        self._perception.judge.restart(reason)
        self._law.reset()
        # Eyes in motion stop where they are, eyes at rest keep the command that brought them there.
        known = self._perception.history.known and self._command is not None
        moving = known and self._command is not None and not self._perception.eyes_still(now_s, self._command)
        self._rest = self._perception.history.reported_rad if moving else _UNKNOWN
        self._send_until_s = now_s + _HOLD_S
        self._phases.enter(Phase.IDLE, reason, now_s)

    def _report(self, now_s: float) -> GazeReport:
        law, mode = self._law.name, self._p.control.mode
        attention, needed = self._attention.describe(), self.uses_images
        fault = self._fault(now_s)
        return make_report(now_s, self._perception, self._phases, law, mode, self._rig, fault, attention, needed)


def _driven(parameters: GazeParameters) -> npt.NDArray[np.bool_]:
    """Return which joints (3,) may move."""
    pans = {"both_eyes": (True, True), "left_held": (False, True), "right_held": (True, False)}[parameters.control.mode]
    return np.array([*pans, parameters.control.tilt_enabled])
