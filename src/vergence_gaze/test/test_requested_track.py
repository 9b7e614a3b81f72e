"""A click asks the tracker for its point; once the tracker answers, nothing else near the fovea is the target."""

from dataclasses import replace

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import Command
from vergence_gaze.estimation.observations import JointReport, Observation, TrackSighting
from vergence_gaze.goals.goal import Goal, GoalKind, Outcome, Result, TrackRequest
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.testing.fake_head import TICK_S, FakeHead, VisionModel
from vergence_rig.rig import JOINT_NAMES, default_rig

PLACE = np.array([0.8, 0.1, 0.02])
NEARER = 0.6 * PLACE


def commands(head: FakeHead, controller: GazeController, until_s: float, answer_as: int | None = None) -> list[Command]:
    """Run in lockstep; `answer_as` overwrites the goal id of the tracker's answers."""
    arrived, done = [], []
    while head.time_s < until_s:
        for observation in head.advance():
            if isinstance(observation, TrackSighting) and answer_as is not None:
                observation = replace(observation, goal_id=answer_as)
            arrived.append(observation)
        if round(head.time_s / TICK_S) % 6 == 0:
            done.append(controller.step(head.time_s, arrived))
            arrived = []
            head.execute(done[-1])
    return done


def clicked(vision: VisionModel, **mistaken) -> tuple[FakeHead, GazeController]:
    head = FakeHead(default_rig(), lambda time_s: PLACE, vision, 3, mistaken=mistaken)
    controller = GazeController(default_rig(), gaze_parameters(), 6 * TICK_S)
    commands(head, controller, 0.2)
    x, y = head.project(PLACE, left=True)
    goal = Goal(GoalKind.PIXEL, left_xy=(float(x), float(y)), stamp_s=0.15, time_limit_s=60.0)
    controller.look_at(goal, head.time_s)
    return head, controller


def test_a_click_asks_for_its_point_in_its_own_image() -> None:
    head, controller = clicked(VisionModel())
    x, y = head.project(PLACE, left=True)
    requests = [command.track_request for command in commands(head, controller, 0.4)]
    assert requests[0] == TrackRequest(1, 0.15, True, (float(x), float(y)))
    assert set(requests[1:]) == {None}


def test_a_fovea_that_sees_something_else_does_not_pull_the_eyes() -> None:
    head, controller = clicked(VisionModel(), fovea=lambda time_s: NEARER)
    done = commands(head, controller, 3.0)
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.25
    assert not any(command.report.phase.name == "LOST" for command in done[20:])


def test_boxes_of_something_else_do_not_pull_the_eyes() -> None:
    head, controller = clicked(VisionModel(boxes=True), box=lambda time_s: NEARER)
    commands(head, controller, 3.0)
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.25


def test_a_track_for_another_goal_is_not_the_target() -> None:
    head, controller = clicked(VisionModel(fovea=False))
    done = commands(head, controller, 0.4) + commands(head, controller, 2.0, answer_as=7)
    assert "has not found the requested target" in done[-1].report.reason or done[-1].report.phase.name in (
        "LOST",
        "SEARCH",
    )
    assert not done[-1].report.verged


@pytest.mark.parametrize("kind", [GoalKind.POINT, GoalKind.CLASS, GoalKind.ANGLES])
def test_a_goal_without_a_pixel_frees_the_tracker(kind: GoalKind) -> None:
    controller = GazeController(default_rig(), gaze_parameters(), 0.02)
    controller.step(1.0, [JointReport(1.0, dict.fromkeys(JOINT_NAMES, 0.0))])
    goal = Goal(kind, point_m=(0.8, 0.0, 0.0), class_name="cube", version_rad=0.1, vergence_rad=0.1, tilt_rad=0.0)
    controller.look_at(goal, 1.0)
    assert controller.step(1.02, []).track_request == TrackRequest(0)


def test_the_result_is_verged_on_the_point() -> None:
    head, controller = clicked(VisionModel(fovea=False))
    outcomes = [outcome for command in commands(head, controller, 3.0) for outcome in command.outcomes]
    assert [outcome.result for outcome in outcomes] == [Result.VERGED], outcomes


def test_a_target_at_one_of_several_distances_is_not_verged_and_the_result_names_them() -> None:
    head, controller = clicked(VisionModel(fovea=False))
    outcomes: list[Outcome] = []
    arrived: list[Observation] = []
    ever = False
    while head.time_s < 5.0:
        for observation in head.advance():
            if isinstance(observation, TrackSighting) and observation.goal_id:
                here = observation.disparity_rad
                observation = replace(
                    observation,
                    ambiguous=True,
                    reason="the target may be at one of several distances",
                    candidates=((here, 0.3), (here + 0.04, 0.25), (here - 0.2, 0.2)),
                )
            arrived.append(observation)
        if round(head.time_s / TICK_S) % 6 == 0:
            command = controller.step(head.time_s, arrived)
            arrived = []
            head.execute(command)
            outcomes += command.outcomes
            ever |= command.report.verged
    assert not ever
    assert [outcome.result for outcome in outcomes] == [Result.AMBIGUOUS], outcomes
    assert "0.81 m, 0.54 m, far away" in outcomes[0].reason
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.5, "the eyes look at the likeliest"
