"""The joints before a photograph: as rig.yaml describes them, or not."""

import math

import pytest

from vergence_rig.rig import default_rig
from vergence_rig.servo import IDEAL, SG90
from vergence_sim.head import CommandError, Head
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.joints import PhotoHead, Plant
from vergence_sim.photo.parameters import PlantParameters

POSE = {"pan_left": 0.3, "pan_right": -0.2, "tilt": 0.1}


def moved(plant=None, until_s=1.0):
    head = PhotoHead(default_rig(), plant)
    head.command(POSE, 0.0)
    for tick in range(1, round(until_s * 100) + 1):
        head.step(0.01 * tick)
    return head


def test_by_default_they_are_the_simulators_joints():
    reference = Head(default_rig(), SimParameters())
    reference.command(POSE, 0.0)
    for tick in range(1, 101):
        reference.step(0.01 * tick)
    head = moved()
    assert head.true_rad == reference.true_rad
    assert head.modelled_rad == reference.modelled_rad == pytest.approx(POSE)


@pytest.mark.parametrize(
    ("plant", "pan_left_rad"),
    [
        (Plant(servo=IDEAL), 0.3),
        # On the way there a shaft stops half a dead band short, with half of the play behind it.
        (
            Plant(dead_band_scale=2.0),
            round(0.3 / SG90.pulse_step_rad) * SG90.pulse_step_rad - SG90.dead_band_rad - 0.5 * SG90.backlash_rad,
        ),
        (Plant(servo=IDEAL, angle_scale=1.06), 0.318),
        (Plant(servo=IDEAL, zero_rad={"pan_left": math.radians(3)}), 0.3 + math.radians(3)),
    ],
)
def test_a_plant_that_differs_goes_elsewhere_and_is_reported_as_described(plant, pan_left_rad):
    head = moved(plant)
    assert head.true_rad["pan_left"] == pytest.approx(pan_left_rad, abs=1e-9)
    assert head.modelled_rad == pytest.approx(POSE)


def test_a_slow_plant_arrives_late():
    slow, described = moved(Plant(speed_scale=0.5), 0.04), moved(until_s=0.04)
    assert slow.velocity_rad_s["pan_left"] == pytest.approx(0.5 * described.velocity_rad_s["pan_left"])
    assert slow.true_rad["pan_left"] < described.true_rad["pan_left"] < 0.3
    assert slow.modelled_rad == described.modelled_rad


def test_commands_are_limited_and_wrong_ones_move_nothing():
    head = PhotoHead(default_rig())
    with pytest.raises(CommandError, match="a joint must be one of pan_left, pan_right, tilt: got 'neck'"):
        head.command({"pan_left": 0.3, "neck": 0.1}, 0.0)
    with pytest.raises(CommandError, match="the command of tilt must be a finite angle"):
        head.command({"pan_left": 0.3, "tilt": math.inf}, 0.0)
    head.step(1.0)
    assert head.true_rad == {"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0}
    head.command({"tilt": 2.0}, 1.0)
    head.step(3.0)
    assert head.modelled_rad["tilt"] == pytest.approx(math.radians(45))


def test_they_rest_where_they_are_put_in_their_play():
    head = PhotoHead(default_rig())
    head.place({"tilt": 0.2}, 5.0, {"tilt": 0.004, "pan_left": -0.003})
    assert head.true_rad == pytest.approx({"pan_left": -0.003, "pan_right": 0.0, "tilt": 0.204})
    assert head.modelled_rad == {"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.2}


def test_parameters_describe_a_plant():
    plant = PlantParameters(servo="mg995", dead_band_scale=2.0, tilt_zero_rad=0.05).plant(default_rig())
    assert plant.spec(SG90).dead_band_rad == pytest.approx(math.radians(0.9))
    assert plant.zero_rad == {"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.05}
    assert PlantParameters().plant(default_rig()).spec(SG90) == SG90
