"""The gaze controller: observations in, joint commands out, one call a cycle. No ROS, no clock of its own."""

import math
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from vergence_gaze.attention.attending import Attending
from vergence_gaze.attention_parameters import DISABLED
from vergence_gaze.control.perception import LATEST_FUTURE_S, Perception
from vergence_gaze.control.report import Command
from vergence_gaze.control.sent_command import SentCommand
from vergence_gaze.control.steering import Steering
from vergence_gaze.estimation.mount_drift import MountDrift
from vergence_gaze.estimation.observations import (
    BoxSighting,
    JointReport,
    JointResolution,
    Observation,
    PointSighting,
)
from vergence_gaze.estimation.vergence_offset import VergenceOffset
from vergence_gaze.goals.goal import Goal, GoalError, Result
from vergence_gaze.goals.goal_monitor import GoalMonitor
from vergence_gaze.goals.goal_pace import pace
from vergence_gaze.goals.goal_resolution import Request, resolve_goal
from vergence_gaze.joints.feedback import FeedbackMonitor
from vergence_gaze.joints.frames import point_in_rig
from vergence_gaze.joints.joint_reports import in_eye_angles
from vergence_gaze.joints.limits import CommandLimits
from vergence_gaze.joints.resolution import pulse_steps_rad, rig_with_steps
from vergence_gaze.parameters import GazeParameters
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_HOLD_S = 0.3
_CLOCK_JUMP_S = 1.0


class GazeController:
    """Steers both eyes and the tilt onto a target and holds them there.

    Time is the caller's, in seconds; the stamps of observations are of the same clock. Joint reports and commands are
    of the joints; everything inside, and every goal and report, is in eye angles (see `vergence_rig.kinematics`).
    """

    def __init__(self, rig: Rig, parameters: GazeParameters, period_s: float = 0.01) -> None:
        self._given, self._described = rig, rig
        self._rig = rig = rig.in_eye_angles()
        self._p = parameters
        self._limits = CommandLimits(rig)
        self._goals = GoalMonitor()
        self._enabled = True
        self._command = SentCommand()
        self._send_until_s = -math.inf
        self._goal_speed_rad_s = math.inf
        self._feedback = FeedbackMonitor()
        self._perception = Perception(rig, parameters)
        self._attention = Attending(rig, parameters)
        self._steering = Steering(
            rig, parameters, period_s, self._perception, self._attention, self._feedback, self._goals.new_id
        )

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
        return self._steering.uses_images

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
        history, speeds = self._perception.history, self._limits.speed_rad_s
        self._goal_speed_rad_s, slow_s = pace(goal, request, history, self._p.control.driven, speeds)
        self._goals.start(goal_id, goal, now_s, self._p, slow_s)
        self._feedback.retry()
        self._steering.begin(request, goal, goal_id, now_s)
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
        elif not self._steering.active:
            self._steering.verge_on_sight(now_s)

    def step(self, now_s: float, observations: Iterable[Observation] = (), joint_fault: str = "") -> Command:
        """Update by what arrived since the last cycle and return what to command now.

        `joint_fault` says why no usable joint_states arrive, as whoever reads them reports it; empty while they do.
        """
        self.observe(observations, now_s)
        steering, history = self._steering, self._perception.history
        report = partial(steering.report, now_s)
        sending = self._enabled and (steering.active or now_s < self._send_until_s)
        if not math.isfinite(now_s):
            return Command(None, report, self._goals.pop_outcomes())
        last_sent = self._command.angles_rad if sending else None
        fault = self._feedback.update(now_s, history, last_sent, steering.driven, joint_fault)
        self._goals.update_feedback(fault, now_s, self._p)
        if not history.known:
            return Command(None, report, self._goals.pop_outcomes())
        command = self._command.angles_rad
        if command is None or not sending:
            command = self._start_from_joints(now_s)
        if not steering.fault(now_s):
            steering.attend(now_s, self._goals.goal_id is not None, self._enabled)
        desired = steering.desired_rad(now_s, command, now_s - self._command.time_s, self._speed_rad_s)
        sent = self._command.update(desired, history.reported_rad, self._present_limits, self._speed_rad_s, now_s)
        self._command.note_limits(desired, self._limits)
        if sending:
            history.on_command(now_s, sent)
        if not fault:
            self._update_goal(now_s, sent)
        joints_rad = np.array(self._described.joint_angles(sent.tolist())) if sending else None
        outcomes, requests = self._goals.pop_outcomes(), steering.requests
        return Command(joints_rad, report, outcomes, requests.pop(), requests.pop_object())

    def rests(self, now_s: float) -> bool:
        """Return whether a step would command nothing and end no goal: `observe` is then enough in most cycles."""
        busy = self._steering.active or now_s < self._send_until_s or self._goals.has_outcomes
        return not busy and self._attention.policy == DISABLED

    def observe(self, observations: Iterable[Observation], now_s: float) -> None:
        """Update by what has arrived, as `step` does.

        If the clock runs back by more than a second, the eyes hold still and everything starts again.
        """
        if now_s < self._command.time_s - _CLOCK_JUMP_S:
            self._perception.on_clock_reset()
            self._feedback.clear()
            self._attention.restart()
            self._command.time_s = now_s
            self._restart("the clock was set back", self._p, now_s)
        for observation in observations:
            self._observe(observation, now_s)
        if self._perception.history.known and self.rests(now_s):
            self._start_from_joints(now_s)

    def _start_from_joints(self, now_s: float) -> Array:
        return self._command.start_at(self._perception.history.reported_rad, self._limits, now_s)

    @property
    def _present_limits(self) -> CommandLimits:
        return self._attention.limits if self._attention.engaged else self._limits

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
                self._steering.follow_choice(observation.object_id, now_s)
        if isinstance(observation, PointSighting) and known and self._goals.goal_id is None and self._enabled:
            self._steering.follow_stream(now_s)
        self._steering.perceive(observation, now_s)
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
        self._command.describe(self._described, rig)
        self._described, self._rig = rig, rig.in_eye_angles()
        self._limits = CommandLimits(self._rig)
        self._attention.set_rig(self._rig)
        self._perception.set_rig(self._rig)
        self._steering.set_rig(self._rig)

    def _update_goal(self, now_s: float, command_rad: Array) -> None:
        if self._goals.goal_id is None:
            return
        progress = self._steering.progress(now_s, command_rad, self._command.beyond_limits)
        if self._goals.update(progress, self._p) is Result.VERGED and progress.pose_reached:
            self._hold("the joints are at the requested angles", now_s)

    def _restart(self, reason: str, parameters: GazeParameters, now_s: float) -> None:
        self._goals.end(Result.CANCELLED, reason, now_s)
        self._p = parameters
        self._perception.configure(parameters)
        self._attention.configure(self._rig, parameters)
        self._steering.configure(self._rig, parameters)
        self._hold(reason, now_s)

    def _hold(self, reason: str, now_s: float) -> None:
        self._steering.hold(reason, now_s, self._command.angles_rad)
        self._send_until_s = now_s + _HOLD_S
