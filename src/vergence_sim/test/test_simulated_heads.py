"""Heads that are not as drawn: printed ones, two different cameras, and what is published of them."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import JOINT_NAMES, EyeMount, RigError, default_rig
from vergence_rig.rig_file import rig_as_mapping, rig_from_mapping
from vergence_rig.testing.odd_heads import SHARES, odd_head
from vergence_sim.heads import HeadParameters, ideal_head, published_cameras, rolled_head, simulated_head
from vergence_sim.parameters import SimParameters
from vergence_sim.printed_head import printed_head
from vergence_sim.renderer import RenderError
from vergence_sim.simulator import Simulator
from vergence_sim.true_gaze import TrueGaze

HEADS = st.lists(st.floats(-1.0, 1.0), min_size=SHARES, max_size=SHARES).map(odd_head)
POINTS = st.tuples(st.floats(0.25, 3.0), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))


def joints_for(head, point_m):
    eyes = Kinematics(head).gaze_for_point(point_m)
    joints = head.joint_angles((eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad))
    return dict(zip(JOINT_NAMES, joints, strict=True))


@given(HEADS, POINTS)
@settings(deadline=None)
def test_mujocos_gaze_is_that_of_the_kinematics(head, point):
    eyes = Kinematics(head).gaze_for_point(point)
    hinges = TrueGaze(head).hinges(np.array(point))
    yaws = (head.left_mount.yaw_rad, head.right_mount.yaw_rad, 0.0)
    # MuJoCo takes frames that differ by a millionth for the same.
    assert hinges + yaws == pytest.approx([eyes.pan_left_rad, eyes.pan_right_rad, eyes.tilt_rad], abs=5e-6)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("point", [(0.3, 0.08, -0.05), (0.8, -0.2, 0.1), (1.5, 0.3, -0.2)])
def test_joints_of_the_kinematics_bring_a_point_to_the_foveas(seed, point):
    simulator = Simulator(SimParameters.of({"head.model": "printed", "head.seed": seed}), render=False)
    head = simulator.head.real
    simulator.set_head(joints_for(head, point))
    # The axes' heights differ by a millimetre or two: neither eye sees the point quite level.
    apart = abs(Kinematics(head).vertical_difference_rad(point))
    assert simulator.angles_to_foveas(point) == pytest.approx((0.5 * apart, 0.5 * apart), abs=1e-6)
    assert simulator.errors_to(point) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_the_truth_says_how_far_foveas_and_principal_points_are():
    head = dataclasses.replace(ideal_head(default_rig()), right_mount=EyeMount(pitch_rad=0.02, yaw_rad=0.03))
    simulator = Simulator(SimParameters.ideal(), render=False, head=head)
    simulator.place_target("cube", (1.0, 0.0, 0.0))
    point = simulator.truth().target_point_m
    simulator.set_head(joints_for(head, point))
    truth = simulator.truth()
    assert (truth.left_error_rad, truth.right_error_rad) == pytest.approx((0.0, 0.0), abs=1e-6)
    # One tilt levels the mean of both cameras.
    off = (truth.left_principal_error_rad, truth.right_principal_error_rad)
    assert off == pytest.approx((0.01, 0.01), abs=1e-6)
    assert truth.left_px[1] == pytest.approx(239.5 + 539 * math.tan(0.01), abs=0.01)
    assert truth.right_px[1] == pytest.approx(239.5 - 539 * math.tan(0.01), abs=0.01)
    wanted = Kinematics(head).gaze_for_point(point)
    assert truth.pan_right_rad == pytest.approx(wanted.pan_right_rad, abs=1e-9)
    assert truth.pan_right_rad == pytest.approx(simulator.true_joints()["pan_right"] + 0.03, abs=1e-9)


def test_printed_heads_are_as_far_off_as_printed_heads_are():
    heads = [printed_head(seed) for seed in range(50)]
    assert heads[0] == printed_head(0) != heads[1]
    deg = math.degrees
    for head in heads:
        mounts, joints = (head.left_mount, head.right_mount), [joint for _, joint in head.joints.items()]
        assert all(0.020 <= mount.lens_x_m <= 0.024 and abs(mount.lens_y_m) <= 0.004 for mount in mounts)
        assert head.tilt_axis_z_m == pytest.approx(-0.045, abs=0.003)
        assert abs(deg(mounts[0].pitch_rad - mounts[1].pitch_rad)) <= 2.0
        assert all(abs(deg(mount.yaw_rad)) <= 3.0 and abs(deg(mount.roll_rad)) <= 2.0 for mount in mounts)
        assert all(abs(deg(joint.zero_rad)) <= 4.0 and 0.95 <= joint.scale <= 1.05 for joint in joints)
        assert 0.009 < abs(head.left_camera.fx_px / head.right_camera.fx_px - 1.0) < 0.032
        for camera in (head.left_camera, head.right_camera):
            assert max(abs(camera.cx_px - 319.5), abs(camera.cy_px - 239.5)) <= 25.0
        assert rig_from_mapping(rig_as_mapping(head)) == head


@pytest.mark.parametrize("model", ["printed", "rolled", "ideal", "rig"])
def test_a_head_has_the_joint_limits_and_servos_of_the_rig(model):
    rig = default_rig().with_servos(default_rig().tilt.servo)
    pan = dataclasses.replace(rig.joints.pan_left, lower_rad=-0.5)
    rig = dataclasses.replace(rig, joints=dataclasses.replace(rig.joints, pan_left=pan))
    head = simulated_head(HeadParameters(model=model), rig)
    for name in JOINT_NAMES:
        found = dataclasses.replace(head.joints[name], zero_rad=0.0, scale=1.0)
        assert found == rig.joints[name]


def test_a_head_may_be_a_file_of_its_own(tmp_path):
    path = tmp_path / "head.yaml"
    path.write_text("baseline_m: 0.08\n")
    assert simulated_head(HeadParameters(model=str(path)), default_rig()).baseline_m == 0.08
    with pytest.raises(RigError, match="'wooden'"):
        simulated_head(HeadParameters(model="wooden"), default_rig())


def test_cameras_publish_what_is_true_what_rig_yaml_says_or_nothing():
    rig, head = default_rig(), rolled_head(default_rig())
    assert published_cameras("calibrated", rig, head) == {"left": head.left_camera, "right": head.right_camera}
    assert published_cameras("nominal", rig, head) == {"left": rig.left_camera, "right": rig.right_camera}
    assert published_cameras("none", rig, head) == {"left": None, "right": None}


def test_two_different_cameras_see_a_thing_where_the_truth_says():
    printed = printed_head(1)
    small = printed.right_camera.replaced(
        width_px=480, height_px=320, cx_px=250.0, cy_px=170.0, fx_px=400.0, fy_px=402.0
    )
    head = dataclasses.replace(printed, right_camera=small)
    try:
        simulator = Simulator(SimParameters.ideal(), head=head)
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")
    simulator.set_head(joints_for(head, (0.6, 0.05, 0.02)))
    simulator.place_target("cube", (0.0, 0.0, -4.0))
    empty = {eye: simulator.view(eye).astype(int) for eye in ("left", "right")}
    assert [empty[eye].shape for eye in ("left", "right")] == [(480, 640, 3), (320, 480, 3)]
    simulator.place_target("cube", (0.6, 0.05, 0.02))
    for eye in ("left", "right"):
        changed = np.abs(simulator.view(eye).astype(int) - empty[eye]).max(axis=2) > 12
        box = next(box for box in simulator.true_boxes(eye) if box.name == "cube")
        rows, columns = np.nonzero(changed)
        found = np.array([columns.min(), rows.min(), columns.max(), rows.max()])
        assert found == pytest.approx([box.x_min_px, box.y_min_px, box.x_max_px, box.y_max_px], abs=2.0)
    simulator.close()
