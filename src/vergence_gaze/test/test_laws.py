"""Each law on the fake head: what all of them reach, and what sets each apart."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_gaze import law_registry
from vergence_gaze.control.controller import GazeController
from vergence_gaze.goals.goal import Goal, GoalKind, Result
from vergence_gaze.joints.servo_inverse import ServoInverse
from vergence_gaze.law_registry import law_names, register_law
from vergence_gaze.laws import make_law
from vergence_gaze.laws.protocol import ControlInput, target_residual
from vergence_gaze.parameter_groups import gaze_groups, gaze_parameters
from vergence_gaze.parameters import GazeParameters, ServoParameters
from vergence_gaze.testing.fake_head import FakeHead, VisionModel
from vergence_rig.parameters import Parameters as ParameterGroup
from vergence_rig.parameters import parameter
from vergence_rig.rig import Rig, default_rig
from vergence_rig.servo import IDEAL, SG90, ServoSpec

PLACE = np.array([0.6, 0.15, 0.08])


def errors_deg(
    law: str, servo: ServoSpec, duration_s: float, vision: VisionModel | None = None
) -> tuple[np.ndarray, Any]:
    """Let a law verge on a place given by a detector; return the true errors (n, 3) at 100 Hz and the outcomes."""
    rig = default_rig().with_servos(servo)
    head = FakeHead(rig, lambda time_s: PLACE, vision or VisionModel(boxes=True), start_rad={"pan_right": 0.06})
    controller = GazeController(rig, gaze_parameters({"law": law}))
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
        head.execute(command)
        outcomes += command.outcomes
        errors.append(np.degrees(head.true_errors_rad()))
    return np.array(errors), outcomes


@pytest.mark.parametrize("servo", [IDEAL, SG90], ids=["ideal", "sg90"])
@pytest.mark.parametrize("law", law_names())
def test_every_law_verges_and_stays(law: str, servo: ServoSpec) -> None:
    errors, outcomes = errors_deg(law, servo, 6.0)
    assert [outcome.result for outcome in outcomes] == [Result.VERGED]
    tolerance = 0.3 if servo is IDEAL else math.degrees(servo.dead_band_rad)
    assert np.abs(errors[-100:]).max() < tolerance


def test_metric_descent_needs_no_signed_disparity() -> None:
    blind = VisionModel(boxes=True, track=False)
    errors, outcomes = errors_deg("metric_descent", IDEAL, 6.0, blind)
    assert outcomes[0].result is Result.VERGED
    assert abs(errors[-1][1]) < 0.5


def test_predictive_is_the_fastest() -> None:
    settled = {}
    for law in law_names():
        errors, _ = errors_deg(law, IDEAL, 6.0)
        settled[law] = int(np.flatnonzero(np.abs(errors).max(axis=1) > 0.3)[-1])
    assert min(settled, key=lambda law: settled[law]) == "predictive"


class HoldingLaw:
    """A law of someone else's: it holds the eyes where they are."""

    @dataclass(frozen=True)
    class Parameters(ParameterGroup):
        """None that it needs; one shows how they are named."""

        gain: float = parameter(2.0, "gain of nothing", minimum=0, maximum=10)

    name = "holding"
    unsigned = False
    lands_at_rest = True

    def __init__(self, rig: Rig, parameters: GazeParameters) -> None:
        self.gain = parameters.of_law(HoldingLaw.Parameters).gain

    def reset(self) -> None:
        pass

    def compute_command(self, state: ControlInput) -> npt.NDArray[np.float64]:
        return np.full(3, math.nan)

    def residual(self, state: ControlInput) -> npt.NDArray[np.float64]:
        return target_residual(state)

    def remaining_rad(self) -> float:
        return 0.0


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> type[HoldingLaw]:
    monkeypatch.setattr(law_registry, "_LAWS", dict(law_registry._LAWS))
    register_law(HoldingLaw)
    return HoldingLaw


def test_a_law_of_someone_elses_is_registered_and_chosen_by_name(registered: type[HoldingLaw]) -> None:
    parameters = gaze_parameters({"law": "holding", "holding.gain": 3.0})
    law = make_law(default_rig(), parameters)
    assert isinstance(law, registered)
    assert law.gain == 3.0
    assert ("holding.", HoldingLaw.Parameters) in gaze_groups()
    errors, outcomes = errors_deg("holding", IDEAL, 1.0)
    assert np.ptp(errors, axis=0).max() == 0.0
    assert not outcomes


def test_two_laws_of_one_name_are_refused(registered: type[HoldingLaw]) -> None:
    with pytest.raises(ValueError, match="holding"):
        register_law(registered)


def test_laws_are_made_by_name() -> None:
    assert [make_law(default_rig(), gaze_parameters({"law": law})).name for law in law_names()] == list(law_names())


@given(
    before=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    wanted=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    then=st.tuples(*[st.floats(-0.01, 0.01)] * 3),
)
def test_pans_that_stay_leave_no_more_of_vergence_than_one_of_them_may(before, wanted, then):
    """Wherever they come from: each may be off by what a small way back is left alone for, both together no more."""
    inverse = ServoInverse(default_rig().with_servos(SG90), ServoParameters(hold_tolerance_rad=0.0008))
    half_play = np.full(3, SG90.half_play_rad)
    left_alone = 0.0008 + 2.0 * 0.17 * SG90.half_play_rad
    shaft, command = np.array(before), np.array(before)
    for place in (np.array(wanted), np.add(wanted, then)):
        for _ in range(8):
            command = inverse.command(place, shaft, command, half_play)
            shaft = np.clip(shaft, command - half_play, command + half_play)
    off = place - shaft
    assert np.abs(off).max() <= left_alone + 1e-9
    assert abs(off[1] - off[0]) <= left_alone + 1e-9


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_servo_inverse_lands_the_shaft_and_then_rests(direction: float) -> None:
    half_play = np.full(3, 0.009)
    servo = ServoSpec(dead_band_rad=0.012, backlash_rad=0.006)
    inverse = ServoInverse(default_rig().with_servos(servo), ServoParameters(hold_tolerance_rad=0.0008))
    half_play = np.full(3, 0.5 * (servo.dead_band_rad + servo.backlash_rad))
    shaft, command = np.zeros(3), np.zeros(3)
    wanted = np.full(3, direction * 0.2)
    for _ in range(5):
        command = inverse.command(wanted, shaft, command, half_play)
        shaft = np.clip(shaft, command - half_play, command + half_play)
    np.testing.assert_allclose(shaft, wanted, atol=1e-12)
    # going on the same way is exact, a small way back is left alone, a larger one crosses most of the play
    further = inverse.command(wanted + direction * 0.01, shaft, command, half_play)
    np.testing.assert_allclose(further - command, direction * 0.01, atol=1e-12)
    np.testing.assert_array_equal(inverse.command(wanted - direction * 0.003, shaft, command, half_play), command)
    back = inverse.command(wanted - direction * 0.01, shaft, command, half_play)
    np.testing.assert_allclose(back, wanted - direction * (0.01 + 0.85 * 0.009), atol=1e-12)
