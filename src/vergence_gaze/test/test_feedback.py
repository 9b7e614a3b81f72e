"""Joint states that stop, are late or are frozen: named, apart from a lost target; nothing is searched meanwhile."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import JointReport, Observation
from vergence_gaze.goals.goal import Goal, GoalKind, Outcome, Result
from vergence_gaze.joints.feedback import FeedbackMonitor
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.phases import Phase
from vergence_gaze.testing.fake_head import FakeHead
from vergence_rig.rig import JOINT_NAMES, default_rig
from vergence_rig.servo import SG90

DRIVEN = np.ones(3, bool)
BEGIN_S = 1.0
END_S = 5.0

Change = Callable[[JointReport], JointReport | None]


class FaultyHead:
    """A controller on a fake head whose joint reports pass through `change`, once that is set."""

    def __init__(self, **head: Any) -> None:
        rig = default_rig().with_servos(SG90)
        self.head = FakeHead(rig, lambda time_s: np.array([0.6, 0.1, 0.05]), seed=2, **head)
        self.controller = GazeController(rig, gaze_parameters())
        self.change: Change = lambda report: report
        self.refusal = ""
        self.outcomes: list[Outcome] = []
        self.commands: list[np.ndarray] = []
        self.reasons: list[str] = []
        self.phases: list[Phase] = []
        self.verged: list[bool] = []
        self._arrived: list[Observation] = []

    def until(self, time_s: float) -> None:
        ticks = 0
        while self.head.time_s < time_s:
            for seen in self.head.advance():
                changed = self.change(seen) if isinstance(seen, JointReport) else seen
                if changed is not None:
                    self._arrived.append(changed)
            ticks += 1
            if ticks % 3:
                continue
            command = self.controller.step(self.head.time_s, self._arrived, self.refusal)
            self._arrived = []
            self.head.execute(command)
            self.report = command.report
            self.outcomes += command.outcomes
            self.reasons.append(command.report.reason)
            self.phases.append(command.report.phase)
            self.verged.append(command.report.verged)
            if command.joints_rad is not None:
                self.commands.append(command.joints_rad)

    def turn(self, version_rad: float, **fields: Any) -> None:
        goal = Goal(GoalKind.ANGLES, version_rad=version_rad, vergence_rad=0.1, tilt_rad=0.0, **fields)
        self.controller.look_at(goal, self.head.time_s)

    def click(self) -> None:
        x, y = self.head.project(self.head.target(self.head.time_s), left=True)
        self.controller.look_at(Goal(GoalKind.PIXEL, left_xy=(x, y), right_xy=(x, y)), self.head.time_s)


def stopped(report: JointReport) -> None:
    return None


def late(report: JointReport) -> JointReport:
    return replace(report, stamp_s=report.stamp_s - 0.3)


def frozen() -> Change:
    first: list[Any] = []

    def hold(report: JointReport) -> JointReport:
        first.append(report.positions_rad)
        return replace(report, positions_rad=first[0])

    return hold


@pytest.mark.parametrize(
    ("change", "text"),
    [(stopped, "joint_states have stopped"), (late, "joint_states are late: the newest is of 0.3")],
    ids=["stopped", "late"],
)
def test_a_search_without_feedback_stops_and_says_why(change: Change, text: str) -> None:
    run = FaultyHead(visible=lambda time_s: False)
    run.until(0.1)
    run.controller.look_at(Goal(GoalKind.CLASS, class_name="cup", time_limit_s=9.0), run.head.time_s)
    run.until(BEGIN_S + 0.5)
    assert Phase.SEARCH in run.phases[-3:]
    run.change = change
    run.until(BEGIN_S + 1.5)
    sent = len(run.commands)
    run.until(END_S)
    assert np.ptp(run.commands[sent:], axis=0).max() == 0.0
    assert run.phases[-1] == Phase.LOST
    assert text in run.report.reason
    assert text in run.report.fault
    assert [outcome.result for outcome in run.outcomes] == [Result.NO_FEEDBACK]
    assert text in run.outcomes[0].reason


def test_frozen_joint_states_while_commands_go_out_name_the_joints() -> None:
    run = FaultyHead()
    run.until(0.1)
    run.change = frozen()
    run.turn(0.4)
    run.until(1.2)
    assert "joints do not follow their commands" in run.report.reason
    assert "pan_left is reported at 0.0 deg, commanded to" in run.report.reason
    assert "tilt" not in run.report.reason
    sent = len(run.commands)
    run.until(4.0)
    assert np.ptp(run.commands[sent:], axis=0).max() == 0.0
    assert [outcome.result for outcome in run.outcomes] == [Result.NO_FEEDBACK]


@pytest.mark.parametrize("change", [stopped, late, frozen()], ids=["stopped", "late", "frozen"])
def test_after_the_fault_a_goal_verges_again(change: Change) -> None:
    run = FaultyHead()
    run.until(0.1)
    run.change = change
    run.until(BEGIN_S)
    run.turn(0.4, time_limit_s=1.0)
    run.until(BEGIN_S + 1.5)
    assert [outcome.result for outcome in run.outcomes] == [Result.NO_FEEDBACK], run.outcomes
    assert not run.verged[-1]
    run.change = lambda report: report
    run.until(run.head.time_s + 1.0)
    assert not run.report.fault
    run.click()
    run.until(run.head.time_s + 2.5)
    assert run.outcomes[-1].result is Result.VERGED, run.outcomes[-1].reason


def test_eyes_that_are_verged_are_no_longer_so_without_feedback() -> None:
    run = FaultyHead()
    run.until(0.1)
    run.click()
    run.until(2.0)
    assert all(run.verged[-3:])
    run.change = stopped
    run.until(3.0)
    assert not run.verged[-1]
    assert "joint_states have stopped" in run.report.reason
    assert "target" not in run.report.reason


def test_a_lost_target_is_no_fault_of_the_feedback() -> None:
    run = FaultyHead(visible=lambda time_s: time_s < 2.0)
    run.until(0.1)
    run.click()
    run.until(6.0)
    assert run.report.phase is Phase.SEARCH
    assert not any("joint" in reason for reason in run.reasons[20:])
    assert not run.report.fault


def test_without_any_joint_state_goals_end_with_the_readers_reason() -> None:
    run = FaultyHead()
    run.change, run.refusal = stopped, "joint_states are refused: names must be ...: got elbow"
    run.controller.look_at(Goal(GoalKind.CLASS, class_name="cup", time_limit_s=60.0), run.head.time_s)
    run.until(3.0)
    run.turn(0.1)
    run.until(3.1)
    assert [outcome.result for outcome in run.outcomes] == [Result.NO_FEEDBACK, Result.INVALID]
    assert all("got elbow" in outcome.reason for outcome in run.outcomes)
    assert "got elbow" in run.report.reason
    assert math.isnan(run.report.tilt_rad)


def test_a_short_gap_is_no_fault() -> None:
    monitor, history = FeedbackMonitor(), ShaftHistory(default_rig())
    history.add(1.0, dict.fromkeys(JOINT_NAMES, 0.0))
    for now_s in np.arange(1.0, 1.4, 0.02):
        assert not monitor.update(float(now_s), history, np.zeros(3), DRIVEN, "")
    for now_s in np.arange(1.4, 3.0, 0.02):
        history.add(float(now_s), dict.fromkeys(JOINT_NAMES, 0.0))
        assert not monitor.update(float(now_s), history, np.zeros(3), DRIVEN, "")


def test_a_held_joint_need_not_follow() -> None:
    monitor, history = FeedbackMonitor(), ShaftHistory(default_rig())
    tilted = np.array([0.0, 0.0, 0.5])

    def fault(now_s: float, driven: Any) -> str:
        history.add(now_s, dict.fromkeys(JOINT_NAMES, 0.0))
        return monitor.update(now_s, history, tilted, np.array(driven), "")

    assert not any(fault(float(now_s), [True, True, False]) for now_s in np.arange(1.0, 3.0, 0.02))
    assert "tilt is reported" in [fault(float(now_s), [True, True, True]) for now_s in np.arange(3.0, 3.6, 0.02)][-1]
