"""Where the eyes are to turn in each cycle: phases, law, search, and what is asked of the tracker and the detector."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from vergence_gaze.attention.attending import Attending
from vergence_gaze.attention_parameters import DISABLED
from vergence_gaze.control.perception import Perception
from vergence_gaze.control.report import GazeReport, make_report
from vergence_gaze.control.search_pattern import Searcher, SearchPattern
from vergence_gaze.control.situations import progress_of, situation_of
from vergence_gaze.control.track_requests import TrackRequests
from vergence_gaze.estimation.observations import Observation
from vergence_gaze.goals.goal import Goal, GoalKind, ObjectRequest, TrackRequest
from vergence_gaze.goals.goal_monitor import Progress
from vergence_gaze.goals.goal_resolution import ClassRequest, MotionRequest, Request, RequestedPose
from vergence_gaze.joints.feedback import FeedbackMonitor
from vergence_gaze.joints.limits import CommandLimits
from vergence_gaze.laws import make_law
from vergence_gaze.laws.protocol import ControlInput
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase, PhaseMachine, Situation
from vergence_rig.rig import Rig

Array = npt.NDArray[np.float64]

_UNKNOWN = np.full(3, np.nan)


class Steering:
    """Decides the eyes' desired angles by what Perception estimates; limits and joints are the caller's.

    Active while it steers: towards a target, a pose, or what attention looks at. Otherwise the eyes rest.
    """

    def __init__(
        self,
        rig: Rig,
        parameters: GazeParameters,
        period_s: float,
        perception: Perception,
        attention: Attending,
        feedback: FeedbackMonitor,
        new_id: Callable[[], int],
    ) -> None:
        """Rest, or wait for something to verge on.

        Args:
            rig: the head in eye angles.
            parameters: of the controller.
            period_s: time between two cycles.
            perception: what is estimated.
            attention: what is looked at while nothing else is asked for.
            feedback: whether the joints' reports can be relied on.
            new_id: returns a goal id for what no goal asked for.
        """
        self._perception, self._attention, self._feedback = perception, attention, feedback
        self._period_s, self._new_id = period_s, new_id
        self._pose: Array | None = None
        self._rest = _UNKNOWN
        self.configure(rig, parameters)
        self.active = self._verges_on_sight = parameters.control.start == "verge"

    def configure(self, rig: Rig, parameters: GazeParameters) -> None:
        """Start again with other parameters."""
        self._p = parameters
        self.driven = parameters.control.driven
        """Which joints (3,) may move."""
        self._phases = PhaseMachine(parameters)
        self.requests = TrackRequests(self._perception, parameters)
        """What is to be asked of the tracker and the detector."""
        tilts, vergence_rad = parameters.control.tilt_enabled, parameters.target.prior_vergence_rad
        self._searcher = Searcher(
            lambda: SearchPattern(rig, tilts, vergence_rad), vergence_rad, parameters.search.dwell_s
        )
        self._lead_s = max(joint.servo.command_latency_s for _, joint in rig.joints.items()) + 0.5 * self._period_s
        self.set_rig(rig)

    def set_rig(self, rig: Rig) -> None:
        """Use another description of the head; the target stays."""
        self._rig, self._limits = rig, CommandLimits(rig)
        self._law = make_law(rig, self._p)

    @property
    def uses_images(self) -> bool:
        """True while what the images show turns the eyes, or may: not while they hold still or go to an angle."""
        return (self.active and self._pose is None) or self._attention.policy != DISABLED

    def perceive(self, observation: Observation, now_s: float) -> None:
        """Update what is estimated by one observation."""
        verging = self._phases.phase in (Phase.VERGE, Phase.FIXATE)
        self._perception.update(observation, now_s, self._law, verging)

    def begin(self, request: Request, goal: Goal, goal_id: int, now_s: float) -> None:
        """Turn to what a goal asks for."""
        self.activate(now_s)
        self._perception.judge.restart()
        self._law.reset()
        self._searcher.stop()
        tracking = self._perception.tracking
        self._free_requests()
        if isinstance(request, RequestedPose):
            tracking.clear()
            self._pose = np.where(self.driven, request.joints_rad, np.nan)
        elif isinstance(request, ClassRequest):
            tracking.request_class(request.class_name, goal_id)
            self.requests.ask_object(ObjectRequest(request.class_name))
        elif isinstance(request, MotionRequest):
            tracking.request_motion(goal_id)
            self.requests.ask(TrackRequest(goal_id, motion=True))
        else:
            start = now_s, request.stamp_s, request.angles_rad, request.covariance, goal_id
            if goal.kind is GoalKind.POINT:
                tracking.request_point(*start)
            else:
                tracking.request_target(*start)
                xy = goal.left_xy if goal.left_eye else goal.right_xy
                self.requests.ask(TrackRequest(goal_id, request.stamp_s, goal.left_eye, xy, goal.extent_rad))
        self._phases.enter(Phase.VERGE, "new goal", now_s)

    def verge_on_sight(self, now_s: float) -> None:
        """Verge on what the left eye looks at, once its image is of eyes at rest."""
        self.activate(now_s)
        self._verges_on_sight = True
        self._perception.tracking.clear()
        self._free_requests()

    def follow_stream(self, now_s: float) -> None:
        """Turn to the points of the stream, without a goal."""
        if not self._perception.tracking.follows_stream:
            self._perception.tracking.request_stream()
            self._free_requests()
            self._perception.judge.restart("the target is a stream of points")
            self.activate(now_s)

    def follow_choice(self, object_id: int, now_s: float) -> None:
        """Turn to the object of the requested class that the detector has chosen instead of the one before."""
        class_name = self._perception.tracking.class_name or ""
        self._turn_to(class_name, 0, f"object {object_id} is the target now", now_s)

    def attend(self, now_s: float, has_goal: bool, enabled: bool) -> None:
        """Look at what attention wants while nothing else is asked for."""
        tracking, attention = self._perception.tracking, self._attention
        streams = tracking.follows_stream and self._perception.unseen_s(now_s) <= self._p.target.lost_after_s
        searching = self._phases.phase is Phase.SEARCH
        if not attention.update(now_s, streams or has_goal, searching, enabled, self._perception.judge.verged):
            return
        self.activate(now_s)
        focus = attention.focus
        if focus is None:
            tracking.clear()
            self._free_requests()
            self._phases.enter(Phase.LOST, attention.describe(), now_s)
        else:
            self.requests.ask_object(ObjectRequest(focus.class_name, focus.object_id))
            if tracking.class_name != focus.class_name or focus.object_id not in (0, tracking.object_id):
                self._turn_to(focus.class_name, focus.object_id, focus.reason, now_s)

    def activate(self, now_s: float) -> None:
        """Steer from now on."""
        self.active, self._pose, self._verges_on_sight = True, None, False
        self._perception.expect_images(now_s)

    def hold(self, reason: str, now_s: float, command_rad: Array | None) -> None:
        """Steer no more: eyes in motion stop where they are, eyes at rest keep the command (3,) that brought them."""
        self.active, self._pose, self._verges_on_sight = False, None, False
        self._perception.tracking.clear()
        self._perception.judge.restart(reason)
        self._law.reset()
        known = self._perception.history.known and command_rad is not None
        moving = known and command_rad is not None and not self._perception.eyes_still(now_s, command_rad)
        self._rest = self._perception.history.reported_rad if moving else _UNKNOWN
        self._phases.enter(Phase.IDLE, reason, now_s)

    def desired_rad(self, now_s: float, command_rad: Array, elapsed_s: float, speed_rad_s: Array) -> Array:
        """Return the desired eye angles (3,), NaN for joints that stay.

        Args:
            now_s: the present.
            command_rad: the last command (3,).
            elapsed_s: time since it was made.
            speed_rad_s: the joints' largest speeds now (3,).
        """
        if not self.active:
            return self._rest
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
        if self._verges_on_sight and unseen and self.requests.ask_for_view(self._new_id(), now_s):
            self._phases.enter(Phase.VERGE, "no goal: verging on what the left eye looks at", now_s)
        state = self._control_input(now_s, command_rad, elapsed_s, speed_rad_s)
        situation = self._situation(state)
        phase = self._phases.update(situation)
        resting = situation.eyes_still and situation.residual_rad <= self._p.saccade.threshold_rad
        self.requests.ask_at_point(resting, now_s)
        if phase is Phase.SEARCH:
            return np.where(self.driven, self._next_place(now_s, speed_rad_s), np.nan)
        self._stop_searching()
        if phase in (Phase.LOST, Phase.IDLE):
            self._perception.judge.restart("the target is lost")
            return _UNKNOWN
        if phase is Phase.SACCADE and self._perception.judge.verged:
            self._perception.judge.restart("a saccade to the target is under way")
        return self._law.compute_command(state if phase is state.phase else replace(state, phase=phase))

    def fault(self, now_s: float) -> str:
        """Return what is wrong with the joints' feedback, or else with the images; "" if nothing is."""
        return self._feedback.fault or self._perception.images_fault(now_s)

    def progress(self, now_s: float, command_rad: Array, beyond_limits: bool) -> Progress:
        """Return what the active goal is judged by, under the last command (3,)."""
        pose_reached: bool | None = None
        if self._pose is not None:
            pose_reached = self._perception.reached(self._pose) and self._perception.eyes_still(now_s, command_rad)
        return progress_of(now_s, self._perception, self._phases, pose_reached, beyond_limits)

    def report(self, now_s: float) -> GazeReport:
        """Return the report of this cycle."""
        law, mode = self._law.name, self._p.control.mode
        attention, fault = self._attention.describe(), self.fault(now_s)
        return make_report(
            now_s, self._perception, self._phases, law, mode, self._rig, fault, attention, self.uses_images
        )

    def _turn_to(self, class_name: str, object_id: int, reason: str, now_s: float) -> None:
        """Start again with an object of a class, this one if an id is given, on behalf of the same goal or of none."""
        self._perception.tracking.request_class(class_name, self._new_id(), object_id)
        self.requests.free()
        self._perception.judge.restart(reason)
        self._law.reset()
        self._phases.enter(Phase.VERGE, reason, now_s)

    def _free_requests(self) -> None:
        self.requests.free()
        self.requests.ask_object(ObjectRequest())

    def _next_place(self, now_s: float, speed_rad_s: Array) -> Array:
        shaft_rad = self._perception.history.shaft_rad
        if self._attention.engaged:
            return self._attention.next_pose(now_s, shaft_rad)
        return self._searcher.next_pose(now_s, shaft_rad, speed_rad_s)

    def _wait(self, now_s: float) -> Array:
        """Let the joints stay where they were sent: during a fault nothing is searched, pursued or verged on."""
        fault = self.fault(now_s)
        self._stop_searching()
        self._law.reset()
        self._perception.judge.restart(fault)
        self._phases.enter(Phase.LOST, fault, now_s)
        return _UNKNOWN

    def _stop_searching(self) -> None:
        self._searcher.stop()
        self._attention.stop_searching()

    def _control_input(self, now_s: float, command_rad: Array, elapsed_s: float, speed_rad_s: Array) -> ControlInput:
        return ControlInput(
            now_s=now_s,
            elapsed_s=max(elapsed_s, 0.0),
            phase=self._phases.phase,
            target=self._perception.tracking.filter,
            visual=self._perception.tracking.visual,
            contrast=self._perception.contrast,
            shaft_rad=self._perception.history.shaft_rad,
            commanded_rad=command_rad,
            driven=self.driven,
            speed_rad_s=speed_rad_s,
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
            active=self.active,
            attends_and_may_search=self._attention.may_search if self._attention.engaged else None,
        )
