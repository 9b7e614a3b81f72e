"""What a head sees of points: equal to the kinematics of all other nodes, with right derivatives."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_calibration.geometry.unknowns import NAMES, index, prior_of, rig_of
from vergence_calibration.geometry.views import LOCAL, HeadViews, Observations, Points, Poses, moved
from vergence_calibration.identification.axis_log import EYES, EyeCamera
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import CameraSpec, EyeMount, Joints, Rig, default_rig

DEG = math.pi / 180


def drawn_rig(seed: int) -> Rig:
    """Return a head with every quantity of its geometry off."""
    draw = np.random.default_rng(seed).uniform
    mounts = [
        EyeMount(
            axis_x_m=draw(-0.01, 0.01),
            axis_z_m=draw(-0.01, 0.01),
            lens_x_m=draw(-0.03, 0.03),
            lens_y_m=draw(-0.01, 0.01),
            lens_z_m=draw(-0.01, 0.01),
            roll_rad=draw(-0.1, 0.1),
            pitch_rad=draw(-0.1, 0.1),
            yaw_rad=draw(-0.1, 0.1),
        )
        for _ in EYES
    ]
    cameras = [
        CameraSpec(
            fx_px=draw(400, 600),
            fy_px=draw(400, 600),
            cx_px=319.5 + draw(-30, 30),
            cy_px=239.5 + draw(-30, 30),
            distortion=(*draw(-0.05, 0.05, 2).tolist(), *draw(-0.002, 0.002, 2).tolist(), 0.0),
        )
        for _ in EYES
    ]
    joints = [
        replace(joint, zero_rad=draw(-0.1, 0.1), scale=draw(0.9, 1.1)) for _, joint in default_rig().joints.items()
    ]
    return Rig(
        baseline_m=draw(0.05, 0.09),
        left_mount=mounts[0],
        right_mount=mounts[1],
        left_camera=cameras[0],
        right_camera=cameras[1],
        joints=Joints(*joints),
        tilt_axis_x_m=draw(-0.02, 0.02),
        tilt_axis_z_m=draw(-0.06, 0.06),
    )


def own_cameras(rig: Rig, calibrated: bool = False) -> dict[str, EyeCamera]:
    return {eye: EyeCamera(CameraModel(rig.camera(eye == "left")), calibrated) for eye in EYES}


def drawn_case(seed: int) -> tuple[Rig, HeadViews, np.ndarray, Points, Observations]:
    rig, random = drawn_rig(seed), np.random.default_rng(seed + 1)
    poses = Poses(random.uniform(-0.4, 0.4, (4, 3)), random.choice([-1.0, 0.0, 1.0], (4, 3)))
    views = HeadViews(rig, own_cameras(rig), poses)
    vector = np.concatenate([prior_of(rig, own_cameras(rig)).means, random.normal(0, 0.005, 12)])
    directions = np.column_stack([np.ones(20), random.uniform(-0.3, 0.3, (20, 2))])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = Points(directions, random.uniform(-0.1, 2.5, 20))
    view, point = (grid.ravel() for grid in np.meshgrid(np.arange(8), np.arange(20)))
    return rig, views, vector, points, Observations(view, point, np.zeros((len(view), 2)))


@settings(deadline=None, max_examples=25, derandomize=True)
@given(seed=st.integers(0, 10_000))
def test_points_are_seen_where_the_kinematics_sees_them(seed: int) -> None:
    rig, views, vector, points, seen = drawn_case(seed)
    pixels, _, _ = views.project(vector, points, seen)
    kinematics = Kinematics(rig)
    half_play = [joint.servo.half_play_rad for _, joint in rig.joints.items()]
    for k in range(len(seen.view)):
        pose, left = seen.view[k] // 2, seen.view[k] % 2 == 0
        off = vector[len(NAMES) + 3 * pose : len(NAMES) + 3 * pose + 3]
        joints = views.poses.joints_rad[pose] - views.poses.arrived[pose] * half_play + off
        *pans, tilt = rig.eye_angles(joints.tolist())
        pan = pans[not left]
        inverse = points.inverse_m[seen.point[k]]
        apart = points.directions[seen.point[k]] - inverse * kinematics.lens(left, pan, tilt)
        ray = kinematics.rotation_rig_from_camera(left, pan, tilt).T @ apart
        expected = CameraModel(rig.camera(left)).ray_to_pixel(ray)[0]
        if np.isfinite(expected).all():  # beyond the lens model's range all other nodes see nothing
            np.testing.assert_allclose(pixels[k], expected, atol=1e-6)


@settings(deadline=None, max_examples=15, derandomize=True)
@given(seed=st.integers(0, 10_000))
def test_derivatives_equal_differences(seed: int) -> None:
    _, views, vector, points, seen = drawn_case(seed)
    _, by_view, by_point = views.project(vector, points, seen)
    step = 1e-6
    rows = np.arange(len(seen.view))
    for place in range(LOCAL):
        changed = [vector.copy(), vector.copy()]
        numeric = np.zeros((len(seen.view), 2))
        for view in range(views.count):
            mine = seen.view == view
            for sign, tried in zip((1, -1), changed, strict=True):
                tried[:] = vector
                tried[views.unknowns[view, place]] += sign * step
            both = [views.project(tried, points, seen)[0][mine] for tried in changed]
            numeric[mine] = (both[0] - both[1]) / (2 * step)
        np.testing.assert_allclose(by_view[rows, :, place], numeric, rtol=1e-5, atol=2e-4)
    for place in range(3):
        offset = np.zeros((20, 3))
        offset[:, place] = step
        both = [views.project(vector, moved(points, sign * offset), seen)[0] for sign in (1, -1)]
        np.testing.assert_allclose(by_point[:, :, place], (both[0] - both[1]) / (2 * step), rtol=1e-5, atol=2e-4)


@pytest.mark.parametrize("calibrated", [False, True])
def test_the_prior_of_a_rig_gives_the_rig(calibrated: bool) -> None:
    rig = drawn_rig(3)
    cameras = own_cameras(rig, calibrated)
    prior = prior_of(rig, cameras)
    again = rig_of(rig, prior.means, cameras)
    np.testing.assert_allclose(prior_of(again, own_cameras(again, calibrated)).means, prior.means, atol=0.005)
    for left in (True, False):
        mount, other = rig.mount(left), again.mount(left)
        assert (other.lens_x_m, other.lens_z_m) == pytest.approx((mount.lens_x_m, mount.lens_z_m), abs=1e-6)
        assert other.yaw_rad == mount.yaw_rad
        assert again.camera(left).fx_px == pytest.approx(rig.camera(left).fx_px, abs=0.01)
    assert (prior.sigmas[index("cx_px", "left")] == 0) == calibrated
