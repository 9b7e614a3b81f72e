"""A point requested in space is looked at where it is; only what the tracker sees there may correct the eyes."""

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.estimation.observations import Observation
from vergence_gaze.goals.goal import Goal, GoalKind, Outcome, Result
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.testing.fake_head import TICK_S, FakeHead, VisionModel
from vergence_rig.rig import default_rig
from vergence_rig.servo import IDEAL
from vergence_rig.testing.ideal_eyes import gaze_for_point

RIG = default_rig().with_servos(IDEAL)
POINT = (0.4, 0.0, 0.0)


def looked_at(target, vision: VisionModel, until_s: float = 3.0, point=POINT) -> tuple[FakeHead, list[Outcome]]:
    head = FakeHead(RIG, lambda time_s: np.array(target), vision, 3)
    controller = GazeController(RIG, gaze_parameters(), 6 * TICK_S)
    outcomes: list[Outcome] = []
    arrived: list[Observation] = []
    asked = False
    while head.time_s < until_s:
        arrived += head.advance()
        if round(head.time_s / TICK_S) % 6:
            continue
        if head.time_s > 0.2 and not asked:
            controller.look_at(Goal(GoalKind.POINT, point_m=point, time_limit_s=60.0), head.time_s)
            asked = True
        command = controller.step(head.time_s, arrived)
        arrived = []
        outcomes += command.outcomes
        head.execute(command)
    return head, outcomes


def off_point_deg(head: FakeHead, point=POINT) -> float:
    eyes = gaze_for_point(point, RIG.baseline_m)
    wanted = np.array([eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad])
    return float(np.abs(np.degrees(head.true_rad - wanted)).max())


@pytest.mark.parametrize(
    "elsewhere",
    [(0.7, 0.0, 0.0), (0.7, -0.028, 0.0), (0.4, 0.03, 0.0), (0.25, 0.0, 0.0)],
    ids=["behind it", "behind it on the left ray", "beside it", "before it"],
)
def test_an_empty_point_is_looked_at_whatever_lies_near(elsewhere) -> None:
    head, outcomes = looked_at(elsewhere, VisionModel(boxes=True))
    assert [outcome.result for outcome in outcomes] == [Result.AT_POINT], outcomes
    assert off_point_deg(head) < 0.3


def test_what_lies_at_the_point_is_verged_on() -> None:
    seen = (0.4, 0.002, 0.002)
    head, outcomes = looked_at(seen, VisionModel())
    assert [outcome.result for outcome in outcomes] == [Result.VERGED], outcomes
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.15
    assert off_point_deg(head, seen) < 0.15


def test_a_tracker_that_does_not_answer_leaves_the_eyes_at_the_point() -> None:
    head, outcomes = looked_at((0.7, 0.0, 0.0), VisionModel(track=False))
    assert [outcome.result for outcome in outcomes] == [Result.AT_POINT], outcomes
    assert "by their joints" in outcomes[0].reason
    assert off_point_deg(head) < 0.3
