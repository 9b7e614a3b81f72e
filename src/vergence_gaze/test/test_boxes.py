"""Boxes of a requested class, alone and beside the tracker that is asked for what they show."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import JointResolution, Observation
from vergence_gaze.goals.goal import Goal, GoalKind, Outcome, Result, TrackRequest
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.testing.fake_head import FakeHead, VisionModel
from vergence_rig.rig import default_rig
from vergence_rig.servo import IDEAL, SG90, ServoSpec

DETECTOR = VisionModel(boxes=True, track=False, box_frame_ticks=30, box_latency_s=0.14, box_noise_px=1.5)
PLACE = np.array([0.8, 0.1, 0.02])


class Run:
    """A controller and a head in lockstep at 100 Hz, with what they did."""

    def __init__(
        self,
        vision: VisionModel,
        mistaken: Mapping[str, Callable[[float], Any]],
        servo: ServoSpec = IDEAL,
        real: ServoSpec | None = None,
        parameters: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        rig = default_rig().with_servos(servo)
        servos = {} if real is None else {name: real for name, _ in rig.joints.items()}
        start = {"pan_right": 0.05}
        self.head = FakeHead(rig, lambda time_s: PLACE, vision, 3, start, mistaken=mistaken, servos=servos)
        self.controller = GazeController(rig, gaze_parameters(parameters))
        self.outcomes: list[Outcome] = []
        self.errors_deg: list[np.ndarray] = []
        self.commands: list[np.ndarray] = []
        self.requests: list[TrackRequest] = []
        self.verged: list[bool] = []
        self.until(0.1)

    def until(self, time_s: float, extra: Callable[[float], list[Observation]] = lambda time_s: []) -> None:
        arrived: list[Observation] = []
        ticks = 0
        while self.head.time_s < time_s:
            arrived += self.head.advance()
            ticks += 1
            if ticks % 3:
                continue
            command = self.controller.step(self.head.time_s, [*arrived, *extra(self.head.time_s)])
            arrived = []
            self.head.execute(command)
            if command.track_request is not None:
                self.requests.append(command.track_request)
            if command.joints_rad is not None:
                self.commands.append(command.joints_rad)
            self.report = command.report
            self.outcomes += command.outcomes
            self.errors_deg.append(np.degrees(self.head.true_errors_rad()))
            self.verged.append(command.report.verged)

    def click(self) -> None:
        x, y = self.head.project(PLACE, left=True)
        goal = Goal(GoalKind.PIXEL, left_xy=(float(x), float(y)), time_limit_s=60.0)
        self.controller.look_at(goal, self.head.time_s)

    def find(self) -> None:
        goal = Goal(GoalKind.CLASS, class_name="target", time_limit_s=60.0)
        self.controller.look_at(goal, self.head.time_s)

    def worst_deg(self, samples: int) -> float:
        return float(np.abs(self.errors_deg[-samples:]).max())


def always(point_m: np.ndarray) -> Callable[[float], np.ndarray]:
    return lambda time_s: point_m


@pytest.mark.parametrize("servo", [IDEAL, SG90], ids=["ideal", "sg90"])
def test_a_slow_detector_is_enough_for_a_class(servo: ServoSpec) -> None:
    run = Run(DETECTOR, {}, servo)
    run.find()
    run.until(3.0)
    assert run.outcomes[0].result is Result.VERGED
    assert run.outcomes[0].time_s < 1.5
    assert run.worst_deg(100) < (0.25 if servo is IDEAL else 0.75)


def test_boxes_of_something_else_change_nothing() -> None:
    elsewhere = np.array([0.5, -0.1, 0.0])
    run = Run(replace(DETECTOR, track=True), {"box": always(elsewhere)})
    run.click()
    run.until(3.0)
    assert run.outcomes[0].result is Result.VERGED
    assert run.worst_deg(100) < 0.25


@pytest.mark.parametrize("episode_s", [0.25, 0.8])
def test_a_track_that_its_boxes_confirm_outlasts_a_distractor(episode_s: float) -> None:
    nearer = np.array([0.5, -0.12, 0.0])
    mistaken = {"box": lambda time_s: nearer if 2.0 < time_s < 2.0 + episode_s else None}
    run = Run(replace(DETECTOR, track=True), mistaken, SG90)
    run.find()
    run.until(4.0)
    assert run.worst_deg(200) < 0.75
    assert all(run.verged[-200:])


def test_a_track_without_a_box_around_it_is_given_up_for_the_boxes() -> None:
    elsewhere = np.array([0.5, -0.12, 0.0])
    seeing = replace(DETECTOR, track=True)
    run = Run(seeing, {"box": lambda time_s: elsewhere if time_s > 2.0 else None})
    run.find()
    run.until(2.9)
    assert run.worst_deg(50) < 0.4
    assert len(run.requests) == 2  # one that frees the tracker, one for the first boxes
    wanted = run.head.project(elsewhere, left=True)
    run.until(3.6)
    assert run.requests[2].xy == pytest.approx(wanted, abs=0.02)


def test_boxes_that_stay_elsewhere_are_followed_in_the_end() -> None:
    nearer = np.array([0.5, -0.12, 0.0])
    run = Run(DETECTOR, {"box": lambda time_s: nearer if time_s > 2.0 else None})
    run.find()
    run.until(5.0)
    assert abs(run.errors_deg[-1][0]) > 10.0


COARSE = SG90.replaced(pulse_step_rad=0.0077)  # a PCA9685 at 50 Hz


def resolution(time_s: float) -> list[Observation]:
    return [JointResolution(time_s, dict.fromkeys(("pan_left", "pan_right", "tilt"), COARSE.pulse_step_rad))]


def test_a_coarse_resolution_is_used_and_widens_the_stated_interval() -> None:
    widths, turns = {}, {}
    for published in (False, True):
        run = Run(VisionModel(), {}, SG90, real=COARSE)
        run.until(0.2, resolution if published else lambda time_s: [])
        run.click()
        run.until(5.0)
        target = run.report.target
        widths[published] = target.high_m - target.low_m
        turns[published] = int(np.count_nonzero(np.abs(np.diff(run.commands[-300:], axis=0)).max(axis=1)))
        if published:
            assert run.outcomes[0].result is Result.VERGED
            assert all(run.verged[-100:])
            assert target.low_m < float(np.linalg.norm(PLACE)) < target.high_m
            np.testing.assert_allclose(run.controller.resolution_rad, COARSE.pulse_step_rad)
    assert widths[True] > 1.3 * widths[False]
    assert turns[True] <= 3


def test_a_resolution_that_cannot_be_changes_nothing() -> None:
    run = Run(VisionModel(), {}, SG90)
    before = run.controller.resolution_rad
    odd = {"pan_left": math.nan, "pan_right": -0.1, "tilt": 9.0, "elbow": 0.01}
    run.until(0.3, lambda time_s: [JointResolution(time_s, odd)])
    np.testing.assert_array_equal(run.controller.resolution_rad, before)
