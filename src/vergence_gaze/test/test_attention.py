"""Attention without a goal, by the controller before a fake head: scan, looks, glances, and goals that win."""

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import GazeReport
from vergence_gaze.estimation.observations import JointResolution, PointSighting
from vergence_gaze.goals.goal import Goal, GoalKind, ObjectRequest, Outcome, Result
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.phases import Phase
from vergence_gaze.testing.fake_head import TARGET_ID, TICK_S, FakeHead, VisionModel
from vergence_rig.rig import default_rig
from vergence_rig.servo import IDEAL, SG90, ServoSpec

Array = npt.NDArray[np.float64]

SEEING = VisionModel(boxes=True)
ATTEND: Mapping[str, Any] = {"start": "attend"}
PLACE = np.array([0.9, 0.1, 0.02])
BESIDE = np.array([1.2, -0.35, -0.05])
OTHER_ID = 7
CYCLE_TICKS = 3


class Run:
    """A controller and a head in lockstep at 100 Hz, with what they did."""

    def __init__(
        self,
        target: Array | Callable[[float], Array] = PLACE,
        parameters: Mapping[str, Any] = MappingProxyType({}),
        servo: ServoSpec = IDEAL,
        others: Mapping[int, tuple[str, Callable[[float], Array]]] = MappingProxyType({}),
        visible: Callable[[float], bool] = lambda time_s: True,
        class_name: str = "face",
        start_rad: Mapping[str, float] = MappingProxyType({"pan_right": 0.05}),
        vision: VisionModel = SEEING,
    ) -> None:
        rig = default_rig().with_servos(servo)
        self.p = gaze_parameters({**ATTEND, **parameters})
        path = target if callable(target) else lambda time_s: np.asarray(target)
        self.head = FakeHead(
            rig, path, vision, 3, start_rad, visible, class_name=class_name, others=others
        )  # fmt: skip
        self.controller = GazeController(rig, self.p)
        self.times_s: list[float] = []
        self.commands: list[Array] = []
        self.reports: list[GazeReport] = []
        self.outcomes: list[Outcome] = []
        self.requests: list[ObjectRequest] = []

    def until(self, time_s: float, extra: Callable[[float], list[Any]] = lambda time_s: []) -> GazeReport:
        arrived: list[Any] = []
        while self.head.time_s < time_s:
            for _ in range(CYCLE_TICKS):
                arrived += self.head.advance()
            command = self.controller.step(self.head.time_s, [*arrived, *extra(self.head.time_s)])
            arrived = []
            self.head.execute(command)
            if command.object_request is not None:
                self.requests.append(command.object_request)
            if command.joints_rad is not None:
                self.times_s.append(self.head.time_s)
                self.commands.append(command.joints_rad)
            self.reports.append(command.report)
            self.outcomes += command.outcomes
        return self.reports[-1]

    def error_deg(self, object_id: int = TARGET_ID) -> float:
        return float(np.degrees(np.abs(self.head.true_errors_rad(object_id)).max()))

    def rates_rad_s(self) -> Array:
        """The joints' commanded speeds (n, 3), of commands that followed one another."""
        steps = np.diff(np.array(self.commands), axis=0)
        passed = np.diff(np.array(self.times_s))
        return np.asarray(steps[passed < 1.5 * CYCLE_TICKS * TICK_S] / (CYCLE_TICKS * TICK_S))


def test_a_face_in_view_is_looked_at_without_a_goal() -> None:
    run = Run()
    report = run.until(2.5)
    assert report.verged
    assert report.attention == "social: the most interesting class in view is face"
    assert run.error_deg() < 0.3
    assert ObjectRequest("face") in run.requests


@pytest.mark.parametrize("servo", [IDEAL, SG90], ids=["ideal", "sg90"])
@pytest.mark.parametrize("place", [(0.6, -0.75, 0.3), (0.9, 0.9, -0.3), (0.8, 0.2, 0.7)])
def test_one_out_of_view_is_found_by_the_scan(place: tuple[float, float, float], servo: ServoSpec) -> None:
    run = Run(np.array(place), servo=servo)
    assert run.until(12.0).verged
    assert any("scanning the room" in report.attention for report in run.reports)
    assert run.error_deg() < (0.3 if servo is IDEAL else 1.0)


def test_with_nothing_to_see_the_room_is_scanned_slowly() -> None:
    run = Run(visible=lambda time_s: False)
    run.until(25.0)
    versions = np.array([0.5 * (c[0] + c[1]) for c in run.commands])
    tilts = np.array([c[2] for c in run.commands])
    assert versions.min() < -0.5
    assert versions.max() > 0.5
    assert tilts.min() < -0.4
    assert tilts.max() > 0.4
    assert np.abs(run.rates_rad_s()).max() <= run.p.attention.scan_speed_rad_s * 1.001


def test_without_a_detector_the_eyes_hold_still() -> None:
    run = Run(vision=VisionModel(boxes=False))
    report = run.until(8.0)
    assert report.attention == "social: no results of a detector arrive (vergence/box)"
    assert np.ptp(np.array(run.commands), axis=0).max() < 0.01


def test_switches_are_smooth_and_rates_bounded() -> None:
    others = {OTHER_ID: ("face", lambda time_s: BESIDE)}
    run = Run(parameters={"attention.glance_every_s": 2.0}, others=others, servo=SG90)
    run.until(12.0)
    rates = run.rates_rad_s()
    assert np.abs(rates).max() <= run.p.attention.speed_rad_s * 1.001
    changes = np.abs(np.diff(rates, axis=0)) / (CYCLE_TICKS * TICK_S)
    assert changes.max() <= run.p.attention.acceleration_rad_s2 * 1.01


def test_a_glance_goes_to_the_other_face_and_back() -> None:
    others = {OTHER_ID: ("face", lambda time_s: BESIDE)}
    run = Run(parameters={"attention.glance_every_s": 2.0}, others=others)
    nearest: list[int] = []
    while run.head.time_s < 8.0:
        run.until(run.head.time_s + 0.1)
        near = [number for number in (TARGET_ID, OTHER_ID) if run.error_deg(number) < 0.7]
        if near and nearest[-1:] != near:
            nearest += near
    assert nearest[:3] == [TARGET_ID, OTHER_ID, TARGET_ID]
    assert ObjectRequest("face", OTHER_ID) in run.requests
    assert any("a glance at object 7 (face)" in report.attention for report in run.reports)


def test_a_face_takes_over_from_a_cube_after_the_least_dwell() -> None:
    comes_s = 3.0

    def beside(time_s: float) -> Array:
        return BESIDE if time_s > comes_s else np.array([1.0, 5.0, 0.0])

    run = Run(class_name="cube", others={OTHER_ID: ("face", beside)})
    assert run.until(comes_s).verged
    assert run.error_deg() < 0.3
    run.until(comes_s + 1.5)
    assert run.error_deg(OTHER_ID) < 0.7
    assert run.reports[-1].attention == "social: face is more interesting than cube"


def test_what_goes_away_is_waited_for_and_then_searched() -> None:
    goes_s = 3.0
    run = Run(visible=lambda time_s: time_s < goes_s)
    assert run.until(goes_s).verged
    held = run.commands[-1]
    run.until(goes_s + 1.2)
    assert np.abs(run.commands[-1] - held).max() < 0.02
    run.until(goes_s + 4.0)
    assert run.reports[-1].phase is Phase.SEARCH
    assert "scanning the room" in run.reports[-1].attention


def test_an_explicit_goal_wins_and_attention_resumes_after_it() -> None:
    run = Run()
    run.until(2.5)
    run.controller.look_at(Goal(GoalKind.ANGLES, version_rad=-0.5, vergence_rad=0.05, tilt_rad=0.1), run.head.time_s)
    report = run.until(4.0)
    assert run.outcomes[-1].result is Result.VERGED
    assert report.attention == "social: waiting, what was asked for comes first"
    assert report.version_rad == pytest.approx(-0.5, abs=0.01)
    # Not slowed down by the limits of attention.
    assert np.abs(run.rates_rad_s()).max() > 2 * run.p.attention.speed_rad_s
    assert run.until(4.0 + run.p.attention.after_goal_s + 6.0).verged
    assert run.error_deg() < 0.3


def test_a_stream_of_points_wins() -> None:
    run = Run()
    run.until(2.0)
    elsewhere = (0.8, -0.4, 0.1)
    report = run.until(4.0, lambda time_s: [PointSighting(time_s, elsewhere, 0.002)])
    assert "waiting" in report.attention
    assert report.version_rad == pytest.approx(math.atan2(-0.4, 0.8), abs=0.03)
    assert run.until(11.0).verged
    assert run.error_deg() < 0.3


def test_after_a_goal_whose_target_is_lost_attention_resumes_at_once() -> None:
    run = Run()
    run.until(0.2)
    run.controller.look_at(Goal(GoalKind.CLASS, class_name="cup", time_limit_s=1.0), run.head.time_s)
    run.until(1.5)
    assert [outcome.result for outcome in run.outcomes] == [Result.LOST]
    assert run.until(1.5 + 3.0).verged
    assert run.error_deg() < 0.3


def test_stop_pauses_it_until_a_policy_is_set() -> None:
    run = Run(visible=lambda time_s: False)
    run.until(3.0)
    run.controller.stop(run.head.time_s)
    run.until(4.0)
    sent = len(run.commands)
    report = run.until(10.0)
    assert len(run.commands) == sent
    assert report.phase is Phase.IDLE
    assert report.attention == "social: stopped until a policy is set or a goal is sent"
    run.controller.set_attention("social", run.head.time_s)
    run.until(14.0)
    assert len(run.commands) > sent


def test_other_steps_of_the_servos_do_not_disturb_it() -> None:
    run = Run()
    assert run.until(2.5).verged
    steps = JointResolution(run.head.time_s, dict.fromkeys(("pan_left", "pan_right", "tilt"), 0.002))
    run.controller.step(run.head.time_s, [steps])
    run.until(3.5)
    assert all("in view is face" in report.attention for report in run.reports[-80:])
    assert all(report.phase is Phase.FIXATE for report in run.reports[-80:])


def test_disabled_holds_the_eyes_still_and_enabling_attends_again() -> None:
    run = Run()
    run.until(2.5)
    run.controller.set_attention("disabled", run.head.time_s)
    report = run.until(3.5)
    assert (report.phase, report.attention) == (Phase.IDLE, "disabled")
    run.controller.set_attention("focused", run.head.time_s)
    assert run.until(6.0).verged
    run.controller.enable(False, run.head.time_s)
    assert run.until(7.0).phase is Phase.IDLE
    run.controller.enable(True, run.head.time_s)
    assert run.until(9.5).verged


def test_without_start_attend_nothing_is_looked_at_until_a_policy_is_set() -> None:
    run = Run(parameters={"start": "idle"})
    report = run.until(3.0)
    assert (report.phase, report.attention, run.commands) == (Phase.IDLE, "disabled", [])
    run.controller.set_attention("social", run.head.time_s)
    assert run.until(6.0).verged


def test_random_looks_anywhere_and_at_no_face() -> None:
    run = Run(parameters={"attention.policy": "random", "attention.random_dwell_s": 0.5})
    run.until(12.0)
    versions = np.round([0.5 * (c[0] + c[1]) for c in run.commands], 2)
    still = versions[:-5][versions[:-5] == versions[5:]]
    assert len(set(still.tolist())) >= 6
    assert np.abs(run.rates_rad_s()).max() <= run.p.attention.speed_rad_s * 1.001
    assert not any(request.class_name for request in run.requests)


def test_another_object_that_the_detector_chooses_is_followed_by_a_class_goal() -> None:
    """As box_metric_node reports it when a nearer one has taken over."""
    run = Run(parameters={"start": "idle"}, others={OTHER_ID: ("face", lambda time_s: BESIDE)})
    run.until(0.2)
    run.controller.look_at(Goal(GoalKind.CLASS, class_name="face", time_limit_s=60.0), run.head.time_s)
    assert run.until(2.0).verged
    assert run.error_deg() < 0.3
    run.head.chosen_id = OTHER_ID
    run.until(3.5)
    assert run.error_deg(OTHER_ID) < 0.7
    assert run.reports[-1].verged


def test_three_that_cross_are_told_apart_by_their_ids() -> None:
    """The eyes stay with the first while the others pass behind it and before it."""
    others = {
        OTHER_ID: ("face", lambda time_s: np.array([1.3, 0.5 - 0.25 * time_s, 0.0])),
        OTHER_ID + 1: ("face", lambda time_s: np.array([0.7, -0.4 + 0.2 * time_s, 0.0])),
    }
    run = Run(parameters={"attention.glance_every_s": 0.0}, others=others)
    run.until(2.0)
    worst = []
    while run.head.time_s < 5.0:
        run.until(run.head.time_s + 0.1)
        worst.append(run.error_deg())
    assert max(worst) < 0.7
