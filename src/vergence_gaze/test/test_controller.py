"""The whole control core against the fake head: clicks, modes, goals and how they end."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import PointSighting
from vergence_gaze.goals.goal import Goal, GoalKind, Outcome, Result
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.parameters import GazeParameters
from vergence_gaze.phases import Phase
from vergence_gaze.testing.fake_head import FakeHead, VisionModel
from vergence_rig.rig import Rig, default_rig
from vergence_rig.servo import IDEAL, MG995, SG90, ServoSpec

ANGLES_DEG = (25.0, 10.0)


class Run:
    """One controller on one fake head, stepped at 100 Hz."""

    def __init__(self, rig: Rig, target_m: Callable[[float], Any], parameters: GazeParameters, **head: Any) -> None:
        self.head = FakeHead(rig, target_m, **head)
        self.controller = GazeController(rig, parameters)
        self.outcomes: list[Outcome] = []
        self.phases: list[Phase] = []
        self.errors_deg: list[np.ndarray] = []
        self.verged: list[bool] = []
        self.joints: list[np.ndarray] = []
        self._arrived: list[Any] = []
        self.until(0.1)

    def until(self, time_s: float, extra: Callable[[float], list[Any]] = lambda time_s: []) -> None:
        ticks = 0
        while self.head.time_s < time_s:
            self._arrived += self.head.advance()
            ticks += 1
            if ticks % 3:
                continue
            command = self.controller.step(self.head.time_s, [*self._arrived, *extra(self.head.time_s)])
            self._arrived = []
            self.head.execute(command)
            self.report = command.report
            self.outcomes += command.outcomes
            self.phases.append(command.report.phase)
            self.errors_deg.append(np.degrees(self.head.true_errors_rad()))
            self.verged.append(command.report.verged)
            self.joints.append(self.head.true_rad)

    def moving(self) -> bool:
        return self.report.target_moving

    def click(self, left: bool = True, **fields: Any) -> int:
        xy = self.head.project(self.head.target(self.head.time_s), left)
        goal = Goal(GoalKind.PIXEL, left_eye=left, left_xy=(xy[0], xy[1]), right_xy=(xy[0], xy[1]), **fields)
        return self.controller.look_at(goal, self.head.time_s)


def fixed(x: float, y: float, z: float) -> Callable[[float], np.ndarray]:
    place = np.array([x, y, z])
    return lambda time_s: place


def rig_with(servo: ServoSpec) -> Rig:
    return default_rig().with_servos(servo)


@pytest.mark.parametrize("servo", [IDEAL, SG90, MG995], ids=["ideal", "sg90", "mg995"])
@pytest.mark.parametrize("place", [(0.3, 0.05, 0.02), (0.6, 0.2, 0.1), (1.9, -0.6, -0.3)])
def test_a_click_without_depth_is_verged_on_and_held(servo: ServoSpec, place: tuple[float, float, float]) -> None:
    run = Run(rig_with(servo), fixed(*place), gaze_parameters(), start_rad={"pan_right": 0.06}, seed=4)
    run.click()
    run.until(2.0)
    assert [outcome.result for outcome in run.outcomes] == [Result.VERGED]
    assert run.outcomes[0].time_s < 1.0
    tolerance = 0.25 if servo is IDEAL else math.degrees(servo.dead_band_rad)
    settled = np.abs(run.errors_deg[-100:])
    assert settled.max() < tolerance
    assert all(run.verged[-100:])
    assert set(run.phases[-100:]) == {Phase.FIXATE}
    assert run.report.target.low_m < np.linalg.norm(place) < run.report.target.high_m


def test_nothing_moves_until_asked() -> None:
    run = Run(rig_with(SG90), fixed(0.5, 0.1, 0.0), gaze_parameters())
    run.until(1.0)
    assert np.ptp(run.joints, axis=0).max() == 0.0
    assert set(run.phases) == {Phase.IDLE}


def test_start_verge_needs_no_goal() -> None:
    run = Run(
        rig_with(IDEAL), fixed(0.5, 0.0325, 0.0), gaze_parameters({"start": "verge"}), start_rad={"pan_right": 0.06}
    )
    run.until(1.5)
    assert run.report.verged
    assert abs(run.errors_deg[-1][1]) < 0.1


@pytest.mark.parametrize(("mode", "held"), [("left_held", 0), ("right_held", 1)])
def test_a_held_eye_does_not_turn(mode: str, held: int) -> None:
    baseline = default_rig().baseline_m
    place = fixed(0.5, (0.5 if held == 0 else -0.5) * baseline, 0.0)  # straight ahead of the held eye
    start = {"pan_right": 0.05} if held == 0 else {"pan_left": -0.05}
    run = Run(rig_with(IDEAL), place, gaze_parameters({"mode": mode, "tilt_enabled": False}), start_rad=start)
    run.click()
    run.until(2.0)
    assert [outcome.result for outcome in run.outcomes] == [Result.VERGED]
    assert np.ptp(np.array(run.joints)[:, held]) == 0.0
    assert abs(run.errors_deg[-1][1]) < 0.1


def test_a_moving_target_is_followed() -> None:
    def ramp(time_s: float) -> np.ndarray:
        azimuth = math.radians(-10.0 + 20.0 * max(min(time_s, 2.5) - 1.0, 0.0))
        return 0.7 * np.array([math.cos(azimuth), math.sin(azimuth), 0.0])

    run = Run(rig_with(IDEAL), ramp, gaze_parameters())
    run.click()
    run.until(2.4)
    assert np.abs(run.errors_deg[-60:]).max() < 1.0
    assert run.moving()
    run.until(4.0)
    assert np.abs(run.errors_deg[-20:]).max() < 0.25
    assert not run.moving()
    assert run.verged[-1]


def test_an_occluded_target_is_lost_honestly_and_found_again() -> None:
    run = Run(
        rig_with(SG90),
        fixed(0.8, 0.1, 0.0),
        gaze_parameters(),
        visible=lambda time_s: not 2.0 < time_s < 3.0,
    )
    run.click()
    run.until(2.0)
    assert run.verged[-1]
    run.until(3.0)
    assert run.phases[-1] in (Phase.LOST, Phase.SEARCH)
    assert not any(run.verged[-5:])
    run.until(4.0)
    assert all(run.verged[-5:])
    assert np.abs(run.errors_deg[-1]).max() < 0.75


def test_a_detected_class_is_searched_and_verged_on() -> None:
    target = fixed(0.5, 0.55, 0.25)
    run = Run(rig_with(SG90), target, gaze_parameters(), vision=VisionModel(boxes=True, track=False))
    run.controller.look_at(Goal(GoalKind.CLASS, class_name="target"), run.head.time_s)
    run.until(5.0)
    assert [outcome.result for outcome in run.outcomes] == [Result.VERGED]
    assert run.phases.count(Phase.SEARCH) > 10
    assert np.abs(run.errors_deg[-1]).max() < 0.75


@pytest.mark.parametrize("image_latency_s", [0.03, 0.12, 0.5])
@pytest.mark.parametrize("contrast", ["required", "when_seen", "ignored"])
def test_a_stream_of_points_is_followed(contrast: str, image_latency_s: float) -> None:
    place = (0.6, -0.2, 0.1)
    vision = VisionModel(latency_s=image_latency_s)
    run = Run(rig_with(IDEAL), fixed(*place), gaze_parameters({"verged.contrast": contrast}), vision=vision)
    # Points are of the present, images of a while ago.
    run.until(1.8, lambda time_s: [PointSighting(time_s, place, math.nan)])
    assert run.report.verged
    assert np.abs(run.errors_deg[-1]).max() < 0.25


def test_a_stream_beside_the_eyes_images_is_not_verged() -> None:
    named, shown = (0.6, -0.2, 0.1), (0.6, 0.1, 0.0)
    run = Run(rig_with(IDEAL), fixed(*shown), gaze_parameters())
    run.until(1.5, lambda time_s: [PointSighting(time_s, named, math.nan)])
    assert not any(run.verged)


def goals_that_end(result: Result) -> list[tuple[Goal, dict[str, Any]]]:
    pixel = Goal(GoalKind.PIXEL, left_xy=(0.0, 0.0))
    endings: dict[Result, list[tuple[Goal, dict[str, Any]]]] = {
        Result.UNREACHABLE: [
            (Goal(GoalKind.POINT, point_m=(0.1, 1.0, 0.0)), {}),
            (Goal(GoalKind.POINT, point_m=(0.0, 0.0, 0.0)), {}),
            (Goal(GoalKind.STEREO_PIXEL, left_xy=(-0.1, 0.0), right_xy=(0.2, 0.0)), {}),
            (Goal(GoalKind.ANGLES, version_rad=0.0, vergence_rad=-0.1, tilt_rad=0.0), {}),
        ],
        Result.INVALID: [
            (Goal(GoalKind.PIXEL), {}),
            (Goal(GoalKind.CLASS), {}),
            (Goal(GoalKind.ANGLES, version_rad=math.nan), {}),
            (Goal(GoalKind.CLASS, class_name="cup", time_limit_s=-1.0), {}),
        ],
        Result.NO_IMAGES: [(pixel, {"vision": VisionModel(latency_s=1e6)})],
        Result.LOST: [(pixel, {"visible": lambda time_s: False})],
        Result.TIMED_OUT: [(pixel, {"vision": VisionModel(track=False), "parameters": {"target.lost_after_s": 9.0}})],
    }
    return endings[result]


ENDINGS = (Result.UNREACHABLE, Result.INVALID, Result.NO_IMAGES, Result.LOST, Result.TIMED_OUT)


@pytest.mark.parametrize("result", ENDINGS, ids=lambda result: result.name.lower())
def test_goals_name_why_they_fail(result: Result) -> None:
    for goal, options in goals_that_end(result):
        parameters = gaze_parameters(options.pop("parameters", {}))
        run = Run(rig_with(SG90), fixed(0.7, 0.1, 0.0), parameters, **options)
        run.controller.look_at(goal, run.head.time_s)
        run.until(6.0)
        assert [outcome.result for outcome in run.outcomes] == [result], (goal, run.outcomes)
        assert run.outcomes[0].reason


def test_eyes_that_diverge_a_little_may_be_held_but_not_turned_farther_apart() -> None:
    # Stopped on their way, one eye may have gone farther than the other.
    start = {"pan_left": 0.004, "pan_right": -0.004, "tilt": 0.0}
    for vergence_rad, results in ((0.0, [Result.VERGED]), (-0.05, [Result.UNREACHABLE])):
        run = Run(rig_with(IDEAL), fixed(0.7, 0.1, 0.0), gaze_parameters(), start_rad=start)
        goal = Goal(GoalKind.RELATIVE_ANGLES, version_rad=0.0, vergence_rad=vergence_rad, tilt_rad=0.0)
        run.controller.look_at(goal, run.head.time_s)
        run.until(3.0)
        assert [outcome.result for outcome in run.outcomes] == results


def test_preempted_cancelled_and_stopped() -> None:
    run = Run(rig_with(SG90), fixed(0.7, 0.1, 0.0), gaze_parameters())
    first, second = run.click(), run.click()
    run.until(0.15)
    run.controller.cancel(run.head.time_s)
    run.click()
    run.controller.stop(run.head.time_s)
    run.until(0.3)
    assert [(o.goal_id, o.result) for o in run.outcomes] == [
        (first, Result.PREEMPTED),
        (second, Result.CANCELLED),
        (second + 1, Result.CANCELLED),
    ]
    assert run.report.phase is Phase.IDLE
