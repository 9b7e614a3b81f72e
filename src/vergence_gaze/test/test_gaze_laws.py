"""Each law on the fake head: what all of them reach, and what sets each apart."""

import math
from typing import Any

import numpy as np
import pytest

from vergence_gaze.control.controller import GazeController
from vergence_gaze.goals.goal import Goal, GoalKind, Result
from vergence_gaze.joints.servo_inverse import ServoInverse
from vergence_gaze.laws import make_law
from vergence_gaze.parameters import LAWS, GazeParameters
from vergence_gaze.testing.fake_head import FakeHead, Seeing
from vergence_rig.rig import default_rig
from vergence_rig.servo import IDEAL, SG90, ServoSpec

PLACE = np.array([0.6, 0.15, 0.08])


def errors_deg(law: str, servo: ServoSpec, duration_s: float, seeing: Seeing | None = None) -> tuple[np.ndarray, Any]:
    """Let a law verge on a place given by a detector; return the true errors (n, 3) at 100 Hz and the outcomes."""
    rig = default_rig().with_servos(servo)
    head = FakeHead(rig, lambda time_s: PLACE, seeing or Seeing(boxes=True, track=False), start_rad={"pan_right": 0.06})
    controller = GazeController(rig, GazeParameters(law=law))
    arrived: list[Any] = []
    errors: list[np.ndarray] = []
    outcomes: list[Any] = []
    for tick in range(int(duration_s * 300)):
        arrived += head.advance()
        if tick % 3:
            continue
        if tick == 30:
            controller.look_at(Goal(GoalKind.CLASS, class_name="target", time_limit_s=60.0), head.time_s)
        command = controller.step(head.time_s, arrived)
        arrived = []
        if command.joints_rad is not None:
            head.command(command.joints_rad)
        outcomes += command.outcomes
        errors.append(np.degrees(head.true_errors_rad()))
    return np.array(errors), outcomes


@pytest.mark.parametrize("servo", [IDEAL, SG90], ids=["ideal", "sg90"])
@pytest.mark.parametrize("law", LAWS)
def test_every_law_verges_and_stays(law: str, servo: ServoSpec) -> None:
    errors, outcomes = errors_deg(law, servo, 6.0)
    assert [outcome.result for outcome in outcomes] == [Result.VERGED]
    tolerance = 0.3 if servo is IDEAL else math.degrees(servo.dead_band_rad)
    assert np.abs(errors[-100:]).max() < tolerance


def test_metric_descent_needs_no_signed_disparity() -> None:
    blind = Seeing(boxes=True, track=False, fovea=False)
    errors, outcomes = errors_deg("metric_descent", IDEAL, 6.0, blind)
    assert outcomes[0].result is Result.VERGED
    assert abs(errors[-1][1]) < 0.5


def test_predictive_is_the_fastest() -> None:
    settled = {}
    for law in LAWS:
        errors, _ = errors_deg(law, IDEAL, 6.0)
        settled[law] = int(np.flatnonzero(np.abs(errors).max(axis=1) > 0.3)[-1])
    assert min(settled, key=lambda law: settled[law]) == "predictive"


def test_laws_are_made_by_name() -> None:
    assert [make_law(default_rig(), GazeParameters(law=law)).name for law in LAWS] == list(LAWS)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_servo_inverse_lands_the_shaft_and_then_rests(direction: float) -> None:
    half_play = np.full(3, 0.009)
    servo = ServoSpec(dead_band_rad=0.012, backlash_rad=0.006)
    inverse = ServoInverse(default_rig().with_servos(servo), 0.0008, 0.85)
    shaft, command = np.zeros(3), np.zeros(3)
    wanted = np.full(3, direction * 0.2)
    for _ in range(5):
        command = inverse.command(wanted, shaft, command)
        shaft = np.clip(shaft, command - half_play, command + half_play)
    np.testing.assert_allclose(shaft, wanted, atol=1e-12)
    # going on the same way is exact, a small way back is left alone, a larger one crosses most of the play
    further = inverse.command(wanted + direction * 0.01, shaft, command)
    np.testing.assert_allclose(further - command, direction * 0.01, atol=1e-12)
    np.testing.assert_array_equal(inverse.command(wanted - direction * 0.003, shaft, command), command)
    back = inverse.command(wanted - direction * 0.01, shaft, command)
    np.testing.assert_allclose(back, wanted - direction * (0.01 + 0.85 * 0.009), atol=1e-12)
