"""The servo plant: each imperfection alone, by number, and the laws all of them keep."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.servo import IDEAL, MG995, PRESETS, SG90, ServoPlant, ServoSpec

DEG = math.pi / 180


def run(plant: ServoPlant, until_s: float, step_s: float = 0.005) -> float:
    angle, count = plant.true_rad, round(until_s / step_s)
    for i in range(count + 1):
        angle = plant.step(i * step_s)
    return angle


def test_speed() -> None:
    plant = ServoPlant(ServoSpec(speed_rad_s=2.0))
    plant.command(1.0, 0.0)
    assert plant.step(0.25) == pytest.approx(0.5)
    assert plant.velocity_rad_s == pytest.approx(2.0)
    assert plant.step(1.0) == 1.0
    assert plant.step(1.1) == 1.0
    assert plant.velocity_rad_s == 0.0


def test_latency_holds_each_command_back() -> None:
    plant = ServoPlant(ServoSpec(speed_rad_s=2.0, command_latency_s=0.1))
    plant.command(1.0, 0.0)
    assert plant.step(0.1) == 0.0
    assert plant.step(0.2) == pytest.approx(0.2)
    assert plant.modelled_rad == pytest.approx(0.2)
    plant.command(0.0, 0.2)
    assert plant.step(0.3) == pytest.approx(0.4)
    assert plant.step(0.4) == pytest.approx(0.2)


def test_one_large_step_equals_many_small_ones() -> None:
    coarse, fine = ServoPlant(SG90), ServoPlant(SG90)
    for plant in (coarse, fine):
        plant.command(0.5, 0.0)
        plant.command(-0.2, 0.03)
    assert coarse.step(0.1) == pytest.approx(run(fine, 0.1, 0.001), abs=1e-9)


def test_dead_band_stops_short_on_the_side_it_came_from() -> None:
    spec = ServoSpec(dead_band_rad=0.02)
    for start, expected in ((-1.0, -0.01), (1.0, 0.01)):
        plant = ServoPlant(spec, start)
        plant.command(0.0, 0.0)
        assert plant.step(5.0) == pytest.approx(expected)
        plant.command(expected * 0.5, 5.0)  # within the dead band: nothing moves
        assert plant.step(6.0) == pytest.approx(expected)
        assert plant.modelled_rad == pytest.approx(expected * 0.5)


def test_pulse_quantisation() -> None:
    plant = ServoPlant(ServoSpec(pulse_step_rad=0.1))
    plant.command(0.26, 0.0)
    assert plant.step(5.0) == pytest.approx(0.3)
    assert plant.modelled_rad == 0.26


def test_backlash_is_lost_motion_at_each_turn() -> None:
    plant = ServoPlant(ServoSpec(backlash_rad=0.02))
    plant.command(1.0, 0.0)
    assert plant.step(1.0) == pytest.approx(0.99)
    plant.command(0.985, 1.0)
    assert plant.step(2.0) == pytest.approx(0.99)
    plant.command(0.5, 2.0)
    assert plant.step(3.0) == pytest.approx(0.51)


@pytest.mark.parametrize(
    ("spec", "sixty_degrees_s"), [(SG90, 0.1), (MG995, 0.2), (IDEAL, 0.1)], ids=["sg90", "mg995", "ideal"]
)
def test_presets_speeds(spec: ServoSpec, sixty_degrees_s: float) -> None:
    assert 60 * DEG / spec.speed_rad_s == pytest.approx(sixty_degrees_s)
    assert PRESETS[spec.name] is spec


@given(st.sampled_from([SG90, MG995, IDEAL]), st.lists(st.floats(-1, 1), min_size=1, max_size=12))
@settings(deadline=None, max_examples=60)
def test_shaft_ends_within_the_uncertainty_and_never_exceeds_its_speed(spec: ServoSpec, angles: list[float]) -> None:
    plant, now_s, before = ServoPlant(spec), 0.0, 0.0
    for angle in angles:
        plant.command(angle, now_s)
        for _ in range(8):
            now_s += 0.01
            true = plant.step(now_s)
            assert abs(true - before) <= spec.speed_rad_s * 0.01 + 1e-12
            before = true
    true = plant.step(now_s + 5.0)
    assert abs(true - angles[-1]) <= spec.uncertainty_rad + 1e-9
    assert plant.modelled_rad == angles[-1]


def test_a_servo_rests_once_its_newest_command_has_had_its_effect() -> None:
    plant = ServoPlant(SG90, 0.0)
    assert plant.at_rest
    plant.command(0.1, 0.0)
    for now_s in (0.0, 0.014, 0.02):
        plant.step(now_s)
        assert not plant.at_rest
    plant.step(0.1)
    assert plant.at_rest
    assert plant.modelled_rad == 0.1


def test_time_does_not_run_backwards() -> None:
    plant = ServoPlant(ServoSpec(speed_rad_s=1.0))
    plant.command(1.0, 0.0)
    assert plant.step(0.5) == pytest.approx(0.5)
    assert plant.step(0.1) == pytest.approx(0.5)
    assert plant.step(0.6) == pytest.approx(0.6)


@pytest.mark.parametrize("angle", [math.nan, math.inf])
def test_angles_that_are_none(angle: float) -> None:
    with pytest.raises(ValueError, match="angle_rad"):
        ServoPlant(IDEAL).command(angle, 0.0)
    with pytest.raises(ValueError, match="initial_rad"):
        ServoPlant(IDEAL, angle)
