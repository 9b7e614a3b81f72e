"""The joints of a head that need not be the one its driver is given."""

import dataclasses
import math

import pytest

from vergence_rig.rig import Joints, default_rig
from vergence_rig.servo import SG90
from vergence_sim.head import CommandError, Head
from vergence_sim.photo.parameters import PlantParameters

POSE = {"pan_left": 0.3, "pan_right": -0.2, "tilt": 0.1}


def moved(real=None, until_s=1.0):
    head = Head(default_rig(), real)
    head.command(POSE, 0.0)
    for tick in range(1, round(until_s * 100) + 1):
        head.step(0.01 * tick)
    return head


def fitted(**plant):
    return PlantParameters(**plant).fitted(default_rig())


def turning(zero_rad, scale):
    rig = fitted(servo="ideal")
    joints = (dataclasses.replace(joint, zero_rad=zero_rad, scale=scale) for _, joint in rig.joints.items())
    return dataclasses.replace(rig, joints=Joints(*joints))


@pytest.mark.parametrize(
    ("real", "pan_left_rad"),
    [
        (fitted(servo="ideal"), 0.3),
        # On the way there a shaft stops half a dead band short, with half of the play behind it.
        (
            fitted(dead_band_scale=2.0),
            round(0.3 / SG90.pulse_step_rad) * SG90.pulse_step_rad - SG90.dead_band_rad - 0.5 * SG90.backlash_rad,
        ),
    ],
)
def test_servos_that_differ_go_elsewhere_and_are_reported_as_described(real, pan_left_rad):
    head = moved(real)
    assert head.true_rad["pan_left"] == pytest.approx(pan_left_rad, abs=1e-9)
    assert head.modelled_rad == pytest.approx(POSE)


def test_axes_turn_by_the_real_zeros_and_scales_and_shafts_as_commanded():
    head = moved(turning(math.radians(3), 1.06))
    assert head.true_rad == pytest.approx(POSE)
    assert head.axes_rad == pytest.approx({name: math.radians(3) + 1.06 * angle for name, angle in POSE.items()})
    plain, scaled = (moved(turning(0.0, scale), 0.03).axis_speeds_rad_s["tilt"] for scale in (1.0, 1.06))
    assert scaled == pytest.approx(1.06 * plain)


def test_slow_servos_arrive_late():
    slow, described = moved(fitted(speed_scale=0.5), 0.04), moved(until_s=0.04)
    assert slow.axis_speeds_rad_s["pan_left"] == pytest.approx(0.5 * described.axis_speeds_rad_s["pan_left"])
    assert slow.true_rad["pan_left"] < described.true_rad["pan_left"] < 0.3
    assert slow.modelled_rad == described.modelled_rad


def test_commands_are_limited_and_wrong_ones_move_nothing():
    head = Head(default_rig())
    with pytest.raises(CommandError, match="joint must be one of pan_left, pan_right, tilt: got 'neck'"):
        head.command({"pan_left": 0.3, "neck": 0.1}, 0.0)
    with pytest.raises(CommandError, match="command of joint tilt must be a finite angle"):
        head.command({"pan_left": 0.3, "tilt": math.inf}, 0.0)
    head.step(1.0)
    assert head.true_rad == {"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0}
    head.command({"tilt": 2.0}, 1.0)
    head.step(3.0)
    assert head.modelled_rad["tilt"] == pytest.approx(math.radians(45))


def test_they_rest_where_they_are_put_in_their_play():
    head = Head(default_rig())
    head.place({"tilt": 0.2, "pan_left": 0.1}, 5.0, {"tilt": 0.004, "pan_left": -0.003})
    assert head.true_rad == pytest.approx({"pan_left": 0.097, "pan_right": 0.0, "tilt": 0.204})
    assert head.modelled_rad == {"pan_left": 0.1, "pan_right": 0.0, "tilt": 0.2}


def test_parameters_describe_servos():
    head = PlantParameters(servo="mg995", dead_band_scale=2.0).fitted(default_rig())
    assert head.pan_left.servo.dead_band_rad == pytest.approx(math.radians(0.9))
    assert PlantParameters().fitted(default_rig()) == default_rig()
