"""A click asks the tracker for its point; once the tracker answers, nothing else near the fovea is the target."""

import math
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


def clicked(
    vision: VisionModel, extent_rad: tuple[float, float] = (math.nan, math.nan), **mistaken
) -> tuple[FakeHead, GazeController]:
    head = FakeHead(default_rig(), lambda time_s: PLACE, vision, 3, mistaken=mistaken)
    controller = GazeController(default_rig(), gaze_parameters(), 6 * TICK_S)
    commands(head, controller, 0.2)
    x, y = head.project(PLACE, left=True)
    goal = Goal(GoalKind.PIXEL, left_xy=(float(x), float(y)), stamp_s=0.15, time_limit_s=60.0, extent_rad=extent_rad)
    controller.look_at(goal, head.time_s)
    return head, controller


def test_a_click_asks_for_its_point_in_its_own_image() -> None:
    head, controller = clicked(VisionModel())
    x, y = head.project(PLACE, left=True)
    requests = [command.track_request for command in commands(head, controller, 0.4)]
    assert requests[0] == TrackRequest(1, 0.15, True, (float(x), float(y)))
    assert set(requests[1:]) == {None}


def test_a_box_asks_for_a_thing_of_its_size() -> None:
    head, controller = clicked(VisionModel(), extent_rad=(0.1, 0.05))
    asked = commands(head, controller, 0.4)[0].track_request
    assert asked is not None
    assert asked.extent_rad == (0.1, 0.05)


def test_boxes_of_something_else_do_not_pull_the_eyes() -> None:
    head, controller = clicked(VisionModel(boxes=True), box=lambda time_s: NEARER)
    commands(head, controller, 3.0)
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.25


def test_a_track_for_another_goal_is_not_the_target() -> None:
    head, controller = clicked(VisionModel())
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


def test_motion_is_waited_for_with_still_eyes_and_then_verged_on() -> None:
    head = FakeHead(default_rig(), lambda time_s: PLACE, VisionModel(), 3, visible=lambda time_s: time_s > 2.0)
    controller = GazeController(default_rig(), gaze_parameters(), 6 * TICK_S)
    commands(head, controller, 0.2)
    controller.look_at(Goal(GoalKind.MOTION, time_limit_s=60.0), head.time_s)
    start = head.true_rad
    waiting = commands(head, controller, 2.0)
    assert [c.track_request for c in waiting if c.track_request is not None] == [TrackRequest(1, motion=True)]
    np.testing.assert_allclose(head.true_rad, start, atol=0.02)
    assert not any(command.outcomes for command in waiting)
    outcomes = [outcome for command in commands(head, controller, 5.0) for outcome in command.outcomes]
    assert [outcome.result for outcome in outcomes] == [Result.VERGED], outcomes
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.5


def test_motion_that_does_not_come_ends_the_goal_with_its_reason() -> None:
    head = FakeHead(default_rig(), lambda time_s: PLACE, VisionModel(), 3, visible=lambda time_s: False)
    controller = GazeController(default_rig(), gaze_parameters(), 6 * TICK_S)
    commands(head, controller, 0.2)
    controller.look_at(Goal(GoalKind.MOTION, time_limit_s=2.0), head.time_s)
    outcomes = [outcome for command in commands(head, controller, 3.0) for outcome in command.outcomes]
    assert [outcome.result for outcome in outcomes] == [Result.LOST], outcomes


def test_the_result_is_verged_on_the_point() -> None:
    head, controller = clicked(VisionModel())
    outcomes = [outcome for command in commands(head, controller, 3.0) for outcome in command.outcomes]
    assert [outcome.result for outcome in outcomes] == [Result.VERGED], outcomes


def test_a_target_at_one_of_several_distances_is_not_verged_and_the_result_names_them() -> None:
    head, controller = clicked(VisionModel())
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
    named = outcomes[0].reason.rpartition(": ")[2].split(", ")
    assert [float(name.removesuffix(" m")) for name in named[:2]] == pytest.approx([0.8, 0.53], rel=0.03)
    assert named[2:] == ["far away"]
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.5, "the eyes look at the likeliest"


def test_a_class_asks_for_what_its_boxes_show_in_their_own_image() -> None:
    head = FakeHead(default_rig(), lambda time_s: PLACE, VisionModel(boxes=True, box_miss_share=0.0), 3)
    controller = GazeController(default_rig(), gaze_parameters(), 6 * TICK_S)
    controller.look_at(Goal(GoalKind.CLASS, class_name="target", time_limit_s=60.0), head.time_s)
    x, y = head.project(PLACE, left=True)
    done = commands(head, controller, 2.0)
    freed, *asked = [command.track_request for command in done if command.track_request is not None]
    assert freed == TrackRequest(0)
    assert (asked[0].goal_id, asked[0].left_eye, asked[0].extent_rad) == (1, True, (0.1, 0.1))
    assert asked[0].stamp_s < 0.2
    assert asked[0].xy == pytest.approx((x, y), abs=0.01)
    assert len(asked) == 1, "a tracker that shows the target is not asked again"
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.5


def test_a_class_that_the_tracker_does_not_show_is_asked_for_again() -> None:
    head = FakeHead(default_rig(), lambda time_s: PLACE, VisionModel(boxes=True, track=False), 3)
    controller = GazeController(default_rig(), gaze_parameters(), 6 * TICK_S)
    controller.look_at(Goal(GoalKind.CLASS, class_name="target", time_limit_s=60.0), head.time_s)
    asked = [command.track_request for command in commands(head, controller, 3.0) if command.track_request is not None]
    stamps_s = [request.stamp_s for request in asked if request.goal_id]
    assert 4 < len(stamps_s) < 10
    assert np.diff(stamps_s).min() > 0.2


def test_without_a_goal_the_tracker_is_asked_for_what_the_left_eye_looks_at() -> None:
    head = FakeHead(default_rig(), lambda time_s: PLACE, VisionModel(), 3, start_rad={"pan_left": 0.08, "tilt": -0.025})
    controller = GazeController(default_rig(), gaze_parameters({"start": "verge"}), 6 * TICK_S)
    done = commands(head, controller, 2.0)
    asked = [command.track_request for command in done if command.track_request is not None]
    assert asked[-1].goal_id > 0
    assert asked[-1].xy == (0.0, 0.0)
    assert done[-1].report.verged


def test_what_the_tracker_loses_without_a_goal_is_not_replaced_while_no_image_arrives() -> None:
    controller = GazeController(default_rig(), gaze_parameters({"start": "verge"}), 0.02)
    controller.step(1.0, [JointReport(1.0, dict.fromkeys(JOINT_NAMES, 0.0))])
    assert all(controller.step(1.0 + 0.02 * i, []).track_request is None for i in range(1, 100))
