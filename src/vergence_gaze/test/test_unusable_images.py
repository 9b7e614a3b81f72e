"""Pictures that the tracker reports as unusable: the eyes are not verged on them, and nothing is searched."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import Observation, TrackSighting
from vergence_gaze.goals.goal import Goal, GoalKind, Outcome, Result
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.phases import Phase
from vergence_gaze.testing.fake_head import FakeHead, VisionModel
from vergence_rig.rig import default_rig
from vergence_rig.servo import SG90

FROZEN = "the left image is frozen: the same picture with new stamps"


class Run:
    """A controller on a fake head whose tracks carry a fault of the images, once it is set."""

    def __init__(self, **head: Any) -> None:
        rig = default_rig().with_servos(SG90)
        self.head = FakeHead(rig, lambda time_s: np.array([0.6, 0.1, 0.05]), seed=2, **head)
        self.controller = GazeController(rig, gaze_parameters())
        self.fault = ""
        self.outcomes: list[Outcome] = []
        self.commands: list[np.ndarray] = []
        self.verged: list[bool] = []
        self.phases: list[Phase] = []
        self._arrived: list[Observation] = []
        self.until(0.1)

    def until(self, time_s: float) -> None:
        ticks = 0
        while self.head.time_s < time_s:
            for seen in self.head.advance():
                if isinstance(seen, TrackSighting) and self.fault:
                    self._arrived.append(replace(seen, usable=False, images_fault=self.fault))
                else:
                    self._arrived.append(seen)
            ticks += 1
            if ticks % 3:
                continue
            command = self.controller.step(self.head.time_s, self._arrived)
            self._arrived = []
            self.head.execute(command)
            self.report = command.report
            self.outcomes += command.outcomes
            self.verged.append(command.report.verged)
            self.phases.append(command.report.phase)
            if command.joints_rad is not None:
                self.commands.append(command.joints_rad)

    def look_at(self, goal: Goal) -> None:
        self.controller.look_at(goal, self.head.time_s)

    def click(self) -> None:
        x, y = self.head.project(self.head.target(self.head.time_s), left=True)
        self.look_at(Goal(GoalKind.PIXEL, left_xy=(x, y), right_xy=(x, y)))


@pytest.mark.parametrize("boxes", [False, True])
def test_eyes_do_not_stay_verged_on_unusable_images(boxes: bool) -> None:
    run = Run(vision=VisionModel(boxes=boxes))
    if boxes:
        run.look_at(Goal(GoalKind.CLASS, class_name="target"))
    else:
        run.click()
    run.until(2.5)
    assert all(run.verged[-20:])
    run.fault = FROZEN
    run.until(2.7)
    begin, sent = len(run.verged), len(run.commands)
    run.until(8.0)
    assert not any(run.verged[begin:])
    assert set(run.phases[begin:]) == {Phase.LOST}
    assert np.ptp(run.commands[sent:], axis=0).max() == 0.0
    assert FROZEN in run.report.reason
    assert run.report.fault == FROZEN
    run.fault = ""
    run.until(11.0)
    assert all(run.verged[-20:])
    assert not run.report.fault


def test_a_goal_on_unusable_images_ends_with_their_fault() -> None:
    run = Run()
    run.fault = FROZEN
    run.until(0.5)
    run.click()
    run.until(4.0)
    assert [(outcome.result, outcome.reason) for outcome in run.outcomes] == [(Result.NO_IMAGES, FROZEN)]


def test_angles_need_no_images() -> None:
    run = Run()
    run.fault = FROZEN
    run.until(0.5)
    run.look_at(Goal(GoalKind.ANGLES, version_rad=0.2, vergence_rad=0.1, tilt_rad=0.0))
    run.until(2.0)
    assert [outcome.result for outcome in run.outcomes] == [Result.VERGED]
