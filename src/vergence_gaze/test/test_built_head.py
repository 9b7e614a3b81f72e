"""A head as it is built: lenses off the axes, horns and mounts askew, joints that turn too far, a tilt axis below."""

from dataclasses import replace

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.control.report import GazeReport
from vergence_gaze.estimation.observations import Observation
from vergence_gaze.goals.goal import Goal, GoalKind, Outcome, Result
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.testing.fake_head import TICK_S, FakeHead, VisionModel
from vergence_rig.rig import EyeMount, Joints, Rig, default_rig
from vergence_rig.servo import IDEAL, SG90, ServoSpec


def built_head(seed: int, servo: ServoSpec) -> Rig:
    random, rig = np.random.default_rng(seed), default_rig().with_servos(servo)

    def about(limit: float, middle: float = 0.0) -> float:
        return float(random.uniform(middle - limit, middle + limit))

    def mount() -> EyeMount:
        return EyeMount(
            lens_x_m=about(0.003, 0.022),
            lens_y_m=about(0.004),
            roll_rad=about(0.035),
            pitch_rad=about(0.03),
            yaw_rad=about(0.05),
        )

    joints = [replace(j, zero_rad=about(0.07), scale=about(0.05, 1.0)) for _, j in rig.joints.items()]
    return replace(rig, left_mount=mount(), right_mount=mount(), tilt_axis_z_m=-0.045, joints=Joints(*joints))


def looked_at(rig: Rig, built: Rig, point: np.ndarray, kind: GoalKind) -> tuple[FakeHead, Outcome, GazeReport]:
    seeing = VisionModel(track=kind is not GoalKind.POINT)
    head = FakeHead(
        rig, lambda time_s: point, seeing, 3, servos={n: j.servo for n, j in built.joints.items()}, built=built
    )
    controller = GazeController(rig, gaze_parameters(), 6 * TICK_S)
    outcomes: list[Outcome] = []
    arrived: list[Observation] = []
    asked, ended_s = False, 6.0
    while head.time_s < min(ended_s + 0.5, 6.0):
        arrived += head.advance()
        if round(head.time_s / TICK_S) % 6:
            continue
        if head.time_s > 0.2 and not asked:
            x, y = head.project(point, left=True)
            controller.look_at(Goal(kind, point_m=tuple(point), left_xy=(x, y), time_limit_s=5.0), head.time_s)
            asked = True
        command = controller.step(head.time_s, arrived)
        arrived = []
        outcomes += command.outcomes
        if outcomes:
            ended_s = min(ended_s, head.time_s)
        head.execute(command)
    return head, outcomes[0], command.report


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("servo", [IDEAL, SG90], ids=["ideal", "sg90"])
def test_a_described_head_verges_on_what_was_clicked_and_states_its_distance(seed: int, servo: ServoSpec) -> None:
    rig = built_head(seed, servo)
    point = np.random.default_rng(seed).uniform((0.3, -0.2, -0.15), (1.5, 0.2, 0.15))
    head, outcome, report = looked_at(rig, rig, point, GoalKind.PIXEL)
    assert outcome.result is Result.VERGED, outcome
    assert np.abs(np.degrees(head.true_errors_rad())).max() < (0.1 if servo is IDEAL else 0.35)
    assert report.target.low_m <= np.linalg.norm(point) <= report.target.high_m


@pytest.mark.parametrize("seed", range(6))
def test_a_described_head_looks_at_a_point_by_its_joints(seed: int) -> None:
    rig = built_head(seed, IDEAL)
    point = np.random.default_rng(seed).uniform((0.3, -0.2, -0.15), (1.5, 0.2, 0.15))
    head, outcome, report = looked_at(rig, rig, point, GoalKind.POINT)
    assert outcome.result is Result.AT_POINT, outcome
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.05
    assert report.fixation_m == pytest.approx(point, abs=0.004)


@pytest.mark.parametrize("seed", [0, 3, 5])
def test_a_head_that_is_not_yet_described_verges_on_what_was_clicked(seed: int) -> None:
    rig = replace(default_rig().with_servos(SG90), zero_sigma_rad=0.05)
    point = np.random.default_rng(seed).uniform((0.3, -0.2, -0.15), (1.5, 0.2, 0.15))
    head, outcome, report = looked_at(rig, built_head(seed, SG90), point, GoalKind.PIXEL)
    assert outcome.result is Result.VERGED, outcome
    assert np.abs(np.degrees(head.true_errors_rad())).max() < 0.35
    assert report.target.high_m > 2.0 * report.target.low_m  # as wide as the zeros are uncertain
