"""Where the eyes were between two reports of their joints."""

import math

import numpy as np
import pytest

from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_rig.rig import JOINT_NAMES, Rig, default_rig
from vergence_rig.servo import IDEAL, SG90, ServoPlant, ServoSpec

PERIOD_S = 0.02
NO_PLAY = SG90.replaced(dead_band_rad=0.0, backlash_rad=0.0, pulse_step_rad=0.0)


def rig_with(servo: ServoSpec) -> Rig:
    return default_rig().with_servos(servo)


def positions(angle_rad: float) -> dict[str, float]:
    return dict.fromkeys(JOINT_NAMES, angle_rad)


def worst_rad(servo: ServoSpec, commands_known: bool, report_phase_s: float = 0.0) -> float:
    """Return how far the history is off between reports while a servo goes along with 60 degrees/s in 50 Hz steps."""
    plant, history, worst = ServoPlant(servo, 0.0), ShaftHistory(rig_with(servo)), 0.0
    samples: list[tuple[float, float]] = []
    for tick in range(1, 600):
        now_s = tick * 0.001
        plant.step(now_s)
        samples.append((now_s, plant.true_rad))
        if tick % 20 == round(report_phase_s * 1e3):
            history.add(now_s, positions(plant.modelled_rad))
        if tick % 20 == 0:
            plant.command(math.radians(60.0) * now_s, now_s)
            if commands_known:
                history.on_command(now_s, np.zeros(3))
    for time_s, true_rad in samples:
        if 0.1 < time_s < 0.5:
            worst = max(worst, abs(float(history.shaft_at(time_s)[0]) - true_rad))
    return worst


@pytest.mark.parametrize("servo", [IDEAL, NO_PLAY], ids=["ideal", "late"])
@pytest.mark.parametrize("report_phase_s", [0.0, 0.007, 0.013])
def test_commands_give_when_the_eyes_turned(servo: ServoSpec, report_phase_s: float) -> None:
    known, unknown = (worst_rad(servo, commands_known, report_phase_s) for commands_known in (True, False))
    assert known < math.radians(0.62)  # half a step, while the samples themselves are one millisecond apart
    assert unknown > math.radians(0.5)
    assert known <= unknown


def test_a_servo_whose_command_fell_on_a_report_turns_right_after_it() -> None:
    history = ShaftHistory(rig_with(IDEAL))
    history.add(1.0, positions(0.0))
    history.on_command(1.0, np.zeros(3))
    history.add(1.02, positions(0.05))
    speed = IDEAL.speed_rad_s
    assert history.reported_at(1.0 + 0.02 / speed)[0] == pytest.approx(0.02)
    assert history.reported_at(1.0 + 0.05 / speed)[0] == pytest.approx(0.05)
    assert history.reported_at(1.015)[0] == pytest.approx(0.05)


def test_a_command_takes_effect_after_the_latency() -> None:
    history = ShaftHistory(rig_with(NO_PLAY))
    history.add(1.0, positions(0.0))
    history.on_command(1.0, np.zeros(3))
    history.add(1.02, positions(0.05))
    assert history.reported_at(1.014)[0] == pytest.approx(0.0)
    assert history.reported_at(1.0149 + 0.05 / NO_PLAY.speed_rad_s)[0] == pytest.approx(0.05, abs=2e-3)


def test_without_a_command_the_way_is_even() -> None:
    history = ShaftHistory(rig_with(IDEAL))
    history.add(1.0, positions(0.0))
    history.add(1.02, positions(0.05))
    np.testing.assert_allclose(history.reported_at(1.005), 0.0125)
    np.testing.assert_allclose(history.reported_at(0.5), 0.0)
    np.testing.assert_allclose(history.reported_at(2.0), 0.05)


def test_the_shaft_follows_its_play_late_between_reports_too() -> None:
    servo = NO_PLAY.replaced(dead_band_rad=0.02)
    history = ShaftHistory(rig_with(servo))
    history.add(1.0, positions(0.0))
    history.add(1.02, positions(0.04))
    np.testing.assert_allclose(history.shaft_at(1.005), 0.0)
    np.testing.assert_allclose(history.shaft_at(1.015), 0.02)
    np.testing.assert_allclose(history.shaft_at(1.02), 0.03)


def test_slip_is_the_speed_beside_the_targets() -> None:
    history = ShaftHistory(rig_with(IDEAL))
    for i in range(4):
        history.add(1.0 + i * PERIOD_S, positions(0.02 * i))
    assert history.speed_within(1.0, 1.06) == pytest.approx(1.0)
    assert history.speed_within(1.0, 1.06, np.full(3, 1.0)) == pytest.approx(0.0, abs=1e-9)
    assert history.speed_within(1.0, 1.06, np.full(3, 0.25)) == pytest.approx(0.75)


def test_a_clock_that_was_set_forgets_the_commands_too() -> None:
    history = ShaftHistory(rig_with(IDEAL))
    history.add(10.0, positions(0.0))
    history.on_command(10.0, np.zeros(3))
    assert history.add(1.0, positions(0.0))
    history.on_command(1.0, np.zeros(3))
    history.add(1.02, positions(0.05))
    assert history.reported_at(1.015)[0] == pytest.approx(0.05)


def test_what_was_sent_since_an_exposure_is_known() -> None:
    history = ShaftHistory(default_rig())
    assert history.sent_since(1.0) == 0.0
    for sent_s, pan_rad in ((1.0, 0.1), (1.02, 0.1), (1.04, 0.13)):
        history.on_command(sent_s, np.array([pan_rad, 0.0, 0.0]))
    assert history.sent_since(1.03) == pytest.approx(0.03)
    assert history.sent_since(1.05) == 0.0
    assert history.sent_since(0.5) == 0.0  # before the first command nothing was sent
