"""The lockstep simulator: truth against closed forms, determinism, plants, pictures."""

import dataclasses
import math
import operator

import numpy as np
import pytest

from vergence_rig.parameters import ParameterError, renamed
from vergence_rig.rig import EyeMount, default_rig
from vergence_rig.testing.ideal_eyes import gaze_for_point
from vergence_sim.head import CommandError
from vergence_sim.heads import ideal_head
from vergence_sim.parameters import GROUPS, SimParameters
from vergence_sim.renderer import RenderError
from vergence_sim.simulator import Simulator, TargetError

HALF_CUBE_M = 0.0285


@pytest.fixture(scope="module")
def blind():
    return Simulator(SimParameters.ideal(), render=False)


@pytest.fixture(scope="module")
def seeing():
    try:
        simulator = Simulator(SimParameters.ideal())
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")
    yield simulator
    simulator.close()


def test_target_point_is_on_the_surface_that_faces_the_head(blind):
    blind.place_target("cube", (0.5, 0.0, 0.0))
    assert blind.truth().target_point_m == pytest.approx([0.5 - HALF_CUBE_M, 0, 0], abs=1e-9)


def test_parallel_eyes_need_the_vergence_of_the_triangle(blind):
    blind.set_head({"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0})
    blind.place_target("cube", (0.5, 0.0, 0.0))
    truth = blind.truth()
    distance, half = 0.5 - HALF_CUBE_M, 0.0325
    assert truth.vergence_error_rad == pytest.approx(2 * math.atan(half / distance))
    assert truth.version_error_rad == pytest.approx(0, abs=1e-12)
    assert truth.left_error_rad == pytest.approx(math.atan(half / distance))
    focal = default_rig().left_camera.fx_px
    assert truth.left_px == pytest.approx((319.5 + focal * half / distance, 239.5))
    assert truth.right_px == pytest.approx((319.5 - focal * half / distance, 239.5))
    # The front face is a plane at right angles to the axes: every pixel of it has one disparity.
    assert truth.mean_disparity_px == pytest.approx(focal * 2 * half / distance, rel=1e-6)


@pytest.mark.parametrize("place", [(0.3, 0.08, 0.02), (0.7, -0.25, 0.12), (1.9, -0.3, -0.3)])
def test_the_rigs_geometry_and_the_simulators_truth_agree(blind, place):
    blind.set_head({"pan_left": -0.1, "pan_right": 0.07, "tilt": 0.05})
    blind.place_target("cube", place)
    truth = blind.truth()
    wanted = gaze_for_point(truth.target_point_m, 0.065)
    assert truth.vergence_error_rad == pytest.approx(wanted.vergence_rad - 0.17, abs=1e-9)
    assert truth.version_error_rad == pytest.approx(wanted.version_rad + 0.015, abs=1e-9)
    assert truth.elevation_error_rad == pytest.approx(wanted.tilt_rad - 0.05, abs=1e-9)
    blind.set_head(wanted.as_dict())
    truth = blind.truth()
    assert max(abs(truth.vergence_error_rad), truth.left_error_rad, truth.right_error_rad) < 1e-7
    assert truth.left_px == pytest.approx((319.5, 239.5), abs=1e-4)
    assert truth.right_px == pytest.approx((319.5, 239.5), abs=1e-4)


def test_an_occluder_hides_the_target(blind):
    blind.set_head({"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0})
    blind.place_target("cube", (1.0, 0.0, 0.0))
    assert blind.truth().left_visible_share == 1.0
    blind.place_object("occluder", (0.5, 0.0, 0.0))
    hidden = blind.truth()
    blind.place_object("occluder", (0.0, 0.0, -5.0))
    assert hidden.left_visible_share == hidden.right_visible_share == 0.0
    assert math.isnan(hidden.mean_disparity_px)
    assert blind.truth().left_visible_share == 1.0


def test_boxes_are_cut_at_the_border_and_absent_outside(blind):
    blind.set_head({"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0})
    blind.place_target("cube", (0.5, 0.0, 0.0))
    (box,) = blind.true_boxes("left")
    assert (box.name, box.cut_left, box.cut_right) == ("cube", False, False)
    side = 539 * 2 * HALF_CUBE_M / (0.5 - HALF_CUBE_M)
    assert box.y_max_px - box.y_min_px == pytest.approx(side, rel=1e-6)
    # The eye is beside the cube's middle, so that it also sees a little of its side.
    assert side < box.x_max_px - box.x_min_px < side + 1
    blind.place_target("cube", (0.5, 0.33, 0.0))
    (box,) = blind.true_boxes("left")
    assert box.cut_left
    assert box.x_min_px == 0.0
    blind.place_target("cube", (0.5, 0.8, 0.0))
    assert blind.true_boxes("left") == []


def test_a_commanded_servo_takes_its_time_and_stops_short():
    simulator = Simulator(SimParameters.of({"servo": "sg90"}), render=False)
    servo = simulator.head.rig.pan_left.servo
    simulator.command({"pan_left": 0.3})
    simulator.advance(servo.command_latency_s * 0.9)
    assert simulator.true_joints()["pan_left"] == 0.0
    simulator.advance(0.01)
    assert 0 < simulator.true_joints()["pan_left"] < 0.3
    simulator.advance(1.0)
    short = 0.3 - simulator.true_joints()["pan_left"]
    assert 0 < short <= 0.5 * (servo.dead_band_rad + servo.backlash_rad) + servo.pulse_step_rad
    assert simulator.joint_states()["pan_left"] == pytest.approx(0.3)


def test_ideal_servos_arrive():
    simulator = Simulator(SimParameters.ideal(), render=False)
    simulator.command({"pan_left": -0.2, "pan_right": 0.1, "tilt": 0.2})
    simulator.advance(1.0)
    assert simulator.true_joints() == pytest.approx({"pan_left": -0.2, "pan_right": 0.1, "tilt": 0.2})


@pytest.mark.parametrize("command", [{"pan_middle": 0.0}, {"pan_left": math.nan}, {"tilt": math.inf}])
def test_a_command_that_cannot_be_moves_nothing(command):
    simulator = Simulator(SimParameters.ideal(), render=False)
    with pytest.raises(CommandError):
        simulator.command({"pan_right": 0.2, **command})
    simulator.advance(1.0)
    assert set(simulator.true_joints().values()) == {0.0}


def test_a_command_is_held_to_the_joints_limits():
    simulator = Simulator(SimParameters.ideal(), render=False)
    simulator.command({"pan_left": 3.0})
    simulator.advance(2.0)
    assert simulator.true_joints()["pan_left"] == pytest.approx(default_rig().pan_left.upper_rad)


@pytest.mark.parametrize(("name", "place"), [("ball", (1, 0, 0)), ("cube", (1, 0)), ("cube", (1, 0, math.nan))])
def test_a_target_that_cannot_be_is_refused(blind, name, place):
    with pytest.raises(TargetError):
        blind.place_target(name, place)


def test_only_one_target_is_shown(blind):
    blind.set_head({"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0})
    blind.place_target("cube", (0.5, 0.05, 0.0))
    blind.place_target("marker", (0.5, -0.05, 0.0))
    assert [box.name for box in blind.true_boxes("left")] == ["marker"]
    blind.set_parameters(blind.parameters.replaced({"target.object": "cube"}))
    blind.place_target("cube", (0.5, 0.0, 0.0))
    assert [box.name for box in blind.true_boxes("left")] == ["cube"]


def test_a_turning_rig_leaves_its_target_behind():
    simulator = Simulator(SimParameters.ideal({"rig_yaw_rate_rad_s": 0.5}), render=False)
    simulator.place_target("cube", (1.0, 0.0, 0.0))
    before = simulator.truth().version_error_rad
    simulator.advance(0.2)
    assert simulator.truth().version_error_rad - before == pytest.approx(-0.1, abs=2e-3)


def test_a_sinusoid_moves_the_target_about_its_place():
    moving = SimParameters.ideal({"motion.kind": "sinusoid", "motion.y_m": 0.1, "motion.frequency_hz": 0.25})
    simulator = Simulator(moving, render=False)
    simulator.place_target("cube", (1.0, 0.0, 0.0))
    simulator.advance(1.0)
    assert simulator.truth().target_point_m[1] == pytest.approx(0.1, abs=0.005)
    simulator.advance(2.0)
    assert simulator.truth().target_point_m[1] == pytest.approx(-0.1, abs=0.005)


def test_a_view_shows_the_cube_where_the_truth_says(seeing):
    seeing.set_head({"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0})
    seeing.place_target("cube", (0.0, 0.0, -4.0))
    empty = seeing.view("left").astype(int)
    seeing.place_target("cube", (0.6, 0.05, 0.02))
    changed = np.abs(seeing.view("left").astype(int) - empty).max(axis=2) > 12
    (box,) = seeing.true_boxes("left")
    rows, columns = np.nonzero(changed)
    found = np.array([columns.min(), rows.min(), columns.max(), rows.max()])
    assert found == pytest.approx([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px], abs=1.5)


def test_the_same_seed_gives_the_same_pictures_and_another_does_not(seeing):
    def picture(seed):
        simulator = Simulator(SimParameters.of({"seed": seed}))
        frame = simulator.capture()
        simulator.close()
        return frame

    first, again, other = picture(3), picture(3), picture(4)
    assert np.array_equal(first.left, again.left)
    assert np.array_equal(first.right, again.right)
    assert not np.array_equal(first.left, other.left)


def test_another_world_seed_is_another_room(seeing):
    other = Simulator(SimParameters.ideal({"world.seed": 1}))
    seeing.set_head({"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0})
    difference = np.abs(other.view("left").astype(int) - seeing.view("left").astype(int)).mean()
    other.close()
    assert difference > 10


def test_a_pitched_camera_sees_what_its_axis_points_at(seeing):
    """Pitch of the right mount moves its picture as a rotation of the camera does."""
    head = dataclasses.replace(ideal_head(default_rig()), right_mount=EyeMount(pitch_rad=0.0093))
    pitched = Simulator(SimParameters.ideal(), head=head)
    for simulator in (pitched, seeing):
        simulator.set_head({"pan_left": 0.0, "pan_right": 0.0, "tilt": 0.0})
        simulator.place_target("cube", (0.8, 0.0, 0.0))
    straight, moved = seeing.truth(), pitched.truth()
    pitched.close()
    assert moved.left_px == pytest.approx(straight.left_px)
    assert straight.right_px[1] - moved.right_px[1] == pytest.approx(539 * math.tan(0.0093), rel=0.02)


def test_a_skewed_capture_lets_time_pass(seeing):
    before = seeing.time_s
    frame = seeing.capture(skew_s=0.007)
    assert frame.left_stamp_s == before
    assert frame.right_stamp_s == pytest.approx(before + 0.007)


def test_pictures_need_a_renderer(blind):
    with pytest.raises(ValueError, match="render=False"):
        blind.view("left")


def test_the_ideal_preset_overrides_every_imperfection():
    preset = SimParameters.of({"preset": "ideal"}).effective()
    imperfections = ("camera.noise_sigma", "right_camera.clock_offset_s", "camera.frame_jitter_s")
    for name in imperfections:
        assert operator.attrgetter(name)(preset) == 0
    assert (preset.simulation.servo, preset.head.model) == ("ideal", "ideal")
    realistic = SimParameters()
    for name in (*imperfections, "camera.latency_s", "camera.jpeg_quality"):
        assert operator.attrgetter(name)(realistic) != 0


def test_parameters_are_replaced_by_their_full_names():
    changed = SimParameters.of({"seed": 3, "world.seed": 4})
    assert (changed.simulation.seed, changed.world.seed) == (3, 4)
    with pytest.raises(ParameterError, match="world_seed"):
        SimParameters.of({"world_seed": 4})
    with pytest.raises(ParameterError, match=r"'motion\.stations_m'"):
        SimParameters.of({"motion.stations_m": (1.0,)})


def test_former_names_lead_to_the_groups():
    former = {old: new for old, (new, _) in renamed(GROUPS).items()}
    assert former["world_seed"] == "world.seed"
    assert former["right_gain"] == "right_camera.gain"
    assert former["target"] == "target.object"
    assert former["motion"] == "motion.kind"
    assert not former.keys() & {prefix + spec.name for prefix, group in GROUPS for spec in group.specs()}
