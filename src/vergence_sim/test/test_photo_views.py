"""Views of photographs are exact: against MuJoCo's kinematics, the rig's geometry, and what is drawn in them."""

import math

import cv2
import numpy as np
import pytest

from vergence_rig.camera import CameraModel
from vergence_rig.geometry import rotation_rig_from_optical
from vergence_rig.rig import CameraSpec, EyeMount, default_rig
from vergence_sim.optics import Lens
from vergence_sim.parameters import SimParameters
from vergence_sim.photo.pair import PhotoPair, PhotoPoint
from vergence_sim.photo.views import PhotoEye, mount_rotation, padded
from vergence_sim.photo.world import PhotoWorld, cropped
from vergence_sim.simulator import Simulator
from vergence_sim.world import EYES

CAMERA = CameraSpec(width_px=480, height_px=320, cx_px=239.5, cy_px=159.5)
DISTORTION = (-0.04, 0.02, 0.0, 0.0, 0.0)


def speckled(seed, height=440, width=712):
    noise = cv2.GaussianBlur(np.random.default_rng(seed).normal(0, 1, (height, width, 3)), (0, 0), 3)
    return np.clip(128 + 50 * noise / noise.std(), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def pair():
    return PhotoPair(speckled(0), speckled(1), 542.0)


def ideal_world(pair, **values):
    return PhotoWorld(pair, SimParameters.ideal(values), cropped(default_rig(), 480, 320))


def test_straight_ahead_a_camera_like_the_photographs_sees_its_middle(pair):
    camera = CAMERA.replaced(fx_px=542.0, fy_px=542.0)
    eye = PhotoEye(padded(pair.left), pair.matrix, Lens(camera), np.eye(3))
    assert np.array_equal(eye.view(0.0, 0.0), pair.left[60:380, 116:596])
    assert eye.outside_share(0.0, 0.0) == 0.0


def test_a_large_photograph_is_seen_as_a_small_one_of_the_same_scene(pair):
    left, right = (
        cv2.resize(image, None, fx=5, fy=5, interpolation=cv2.INTER_CUBIC) for image in (pair.left, pair.right)
    )
    worlds = [ideal_world(pair), ideal_world(PhotoPair(left, right, 5 * 542.0))]
    for world in worlds:
        world.head.place({"pan_left": 0.1, "pan_right": 0.05, "tilt": -0.06})
    for eye in EYES:
        small, big = (world.view(eye).astype(float) for world in worlds)
        assert np.abs(small - big).mean() < 1.5
        assert worlds[1].outside_share(eye) == pytest.approx(worlds[0].outside_share(eye), abs=0.01)


def test_texture_too_fine_for_a_view_is_no_noise():
    fine = np.random.default_rng(3).integers(0, 256, (2200, 3560, 3), dtype=np.uint8)
    world = ideal_world(PhotoPair(fine, fine))
    # Areas of about 4.5 by 4.5 px are averaged: without that the deviation would be about 70.
    assert world.view("left").std() < 25


@pytest.mark.parametrize(("pan", "tilt"), [(0.1, 0.0), (-0.12, 0.05), (0.05, -0.08)])
@pytest.mark.parametrize("distortion", [(0.0,) * 5, DISTORTION])
def test_what_is_drawn_at_a_point_is_seen_where_the_kinematics_put_it(pair, pan, tilt, distortion):
    drawn = np.zeros_like(pair.left)
    cv2.circle(drawn, (350, 230), 4, (255, 255, 255), -1, cv2.LINE_AA)
    mount = mount_rotation(EyeMount(roll_rad=0.03, pitch_rad=0.02, yaw_rad=0.01))
    eye = PhotoEye(padded(drawn), pair.matrix, Lens(CAMERA.replaced(distortion=distortion)), mount)
    image = eye._lens.apply(eye.view(pan, tilt))[:, :, 0].astype(float)
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    centre = np.array([(columns * image).sum(), (rows * image).sum()]) / image.sum()
    ray_of_photograph = np.linalg.inv(pair.matrix) @ (350.0, 230.0, 1.0)
    rig = rotation_rig_from_optical(0.0, 0.0) @ ray_of_photograph
    optical = rotation_rig_from_optical(0.0, 0.0)
    in_mount = optical.T @ mount.T @ optical
    ray = in_mount @ rotation_rig_from_optical(pan, tilt).T @ rig
    expected = CameraModel(CAMERA.replaced(distortion=distortion)).ray_to_pixel(ray[None, :])[0]
    assert centre == pytest.approx(expected, abs=0.05)
    assert eye.project(rig, pan, tilt) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("model", ["rolled", "printed"])
def test_heads_turn_as_the_simulators_do(pair, model):
    """MuJoCo's own kinematics, for a place so far away that the eyes' own places do not matter."""
    values = SimParameters.of({"head.model": model, "head.seed": 3})
    world = PhotoWorld(pair, values, cropped(default_rig(), 480, 320))
    simulator = Simulator(values, world.rig, render=False, head=world.head.real)
    pose = {"pan_left": 0.1, "pan_right": -0.05, "tilt": 0.12}
    simulator.set_head(pose)
    world.head.place(pose)
    point = PhotoPoint(400.0, 150.0, 0.0)
    far = 1e5 * pair.rays(point)[0]
    assert world.angles_to_foveas(point) == pytest.approx(simulator.angles_to_foveas(far), abs=1e-6)
    assert world.errors_to(point) == pytest.approx(simulator.errors_to(far), abs=1e-6)
    for eye in EYES:
        ideal = simulator.project(eye, far)
        assert world.project(eye, point) == pytest.approx(world.lenses[eye].distorted(ideal), abs=2e-3)


def test_at_the_fixation_both_foveas_are_on_the_point(pair):
    world = ideal_world(pair)
    point = PhotoPoint(500.0, 100.0, 35.0)
    before = world.errors_to(point)
    wanted = pair.fixation(point)
    assert before == pytest.approx((wanted.vergence_rad, wanted.version_rad, wanted.tilt_rad))
    # Beside the straight ahead, to the right of it and up: pan and tilt have to shrink.
    assert before[0] > 0 > max(before[1:])
    world.head.place(wanted.as_dict())
    assert world.errors_to(point) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    for eye in EYES:
        assert world.project(eye, point) == pytest.approx((239.5, 159.5), abs=1e-9)


def test_both_eyes_see_one_patch_alike_where_they_fixate_it():
    """The two photographs are one picture, shifted by a known disparity."""
    texture = speckled(2, 440, 760)
    pair = PhotoPair(texture[:, :712], texture[:, 30:742], 542.0)
    world = ideal_world(pair)
    point = PhotoPoint(360.0, 220.0, 30.0)
    world.head.place(pair.fixation(point).as_dict())
    left, right = (world.view(eye)[140:180, 220:260].astype(float) for eye in EYES)
    assert np.abs(left - right).mean() < 3.0
    world.head.place({**pair.fixation(point).as_dict(), "pan_right": 0.0})
    assert np.abs(left - world.view("right")[140:180, 220:260]).mean() > 20.0


def test_the_photographs_frame_makes_no_edge():
    image = np.full((200, 300, 3), 30, np.uint8)
    image[:, 150:] = 220
    grown = padded(image).image[:, :, 0].astype(float)
    assert np.array_equal(grown[160:360, 160:460], image[:, :, 0])
    # From the frame outwards the dark half fades to the mean colour, step by small step; nowhere as far as the edge.
    outwards = grown[260, :161]
    assert np.abs(np.diff(outwards)).max() < 8.0
    assert grown[0, 0] == pytest.approx(125.0, abs=1.0)


def test_what_lies_outside_is_counted(pair):
    world = ideal_world(pair)
    assert world.outside_share("left") == 0.0
    world.head.place({"pan_left": math.atan(356.0 / 542.0), "tilt": 0.0})
    assert world.outside_share("left") == pytest.approx(0.5, abs=0.05)
    world.head.place({"pan_left": 1.0, "tilt": 0.7})
    assert world.outside_share("left") == 1.0
    assert np.ptp(world.view("left")[0, 0].astype(int) - world.view("left")[-1, -1]) == 0


def test_a_turning_eyes_picture_smears(pair):
    moving = PhotoWorld(pair, SimParameters.ideal().replaced({"preset": "realistic", "camera.exposure_s": 0.01}))
    moving.command({"pan_left": 0.5})
    moving.advance_to(0.03)
    assert moving.head.axis_speeds_rad_s["pan_left"] > 5
    still = PhotoWorld(pair, SimParameters.ideal())
    still.head.place({"pan_left": moving.head.true_rad["pan_left"]})
    across = [np.abs(np.diff(w.view("left").astype(float), axis=1)).mean() for w in (still, moving)]
    assert across[1] < 0.6 * across[0]


def test_the_same_seed_gives_the_same_pictures(pair):
    views = [PhotoWorld(pair, SimParameters.of({"seed": seed})).view("right") for seed in (3, 3, 4)]
    assert np.array_equal(views[0], views[1])
    assert not np.array_equal(views[0], views[2])


def test_a_cropped_rig_keeps_its_axes_in_the_middle():
    rig = cropped(default_rig(), 480, 320)
    assert (rig.left_camera.cx_px, rig.left_camera.cy_px, rig.left_camera.fx_px) == (239.5, 159.5, 539.0)
    assert cropped(default_rig(), 0, 0) == default_rig()
    assert cropped(default_rig(), 10_000, 320).left_camera.width_px == 640
