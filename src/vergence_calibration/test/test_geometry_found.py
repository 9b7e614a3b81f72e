"""A head's geometry found from what its eyes would see: drawn points, noise, wrong matches, servos with play."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pytest
import yaml

from vergence_calibration.geometry.geometry_report import geometry_lines, geometry_record
from vergence_calibration.geometry.identify_geometry import (
    FoundGeometry,
    Look,
    _in_whole_images,
    identify_geometry,
    solved,
)
from vergence_calibration.geometry.poses import PoseParameters, planned_poses, visited
from vergence_calibration.geometry.stereo_file import mount_constraint, read_stereo
from vergence_calibration.geometry.unknowns import index
from vergence_calibration.geometry.views import Observations, Poses
from vergence_calibration.identification.axis_log import EYES, EyeCamera, IdentifyError
from vergence_calibration.identification.identified_rig import recorded, rig_text
from vergence_rig.camera import CameraModel
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import JOINT_NAMES, CameraSpec, EyeMount, Joints, Rig, default_rig
from vergence_rig.rig_file import load_rig
from vergence_rig.servo import ServoPlant

Array = npt.NDArray[np.float64]

DEG = math.pi / 180
NOISE_PX, WRONG_SHARE, SEEN_SHARE = 0.3, 0.03, 0.4


def printed_rig(seed: int) -> Rig:
    """Return a head as a person might print and screw it together."""
    draw = np.random.default_rng(seed).uniform
    mounts = [
        EyeMount(
            lens_x_m=draw(0.018, 0.026),
            lens_y_m=draw(-0.004, 0.004),
            lens_z_m=height,
            roll_rad=draw(-2, 2) * DEG,
            pitch_rad=draw(-2, 2) * DEG,
        )
        for height in (0.0005, -0.0005)
    ]
    focal_px = draw(520, 560)
    cameras = [
        CameraSpec(
            fx_px=focal_px * ratio,
            fy_px=focal_px * ratio,
            cx_px=319.5 + draw(-25, 25),
            cy_px=239.5 + draw(-25, 25),
            distortion=(-0.04, 0.02, 0.0, 0.0, 0.0),
        )
        for ratio in (1.0, draw(0.98, 1.02))
    ]
    base = default_rig()
    joints = [
        replace(joint, zero_rad=0.0 if name == "tilt" else draw(-4, 4) * DEG, scale=draw(0.95, 1.05))
        for name, joint in base.joints.items()
    ]
    return replace(
        base,
        left_mount=mounts[0],
        right_mount=mounts[1],
        left_camera=cameras[0],
        right_camera=cameras[1],
        joints=Joints(*joints),
        tilt_axis_x_m=draw(-0.005, 0.005),
        tilt_axis_z_m=-0.045 + draw(-0.003, 0.003),
    )


@dataclass(frozen=True)
class Room:
    """Points drawn around a head, at distances of a range [m]."""

    nearest_m: float = 0.4
    furthest_m: float = 4.0
    count: int = 700


def sightings(truth: Rig, room: Room, seed: int, stops_anywhere: bool = False) -> tuple[Observations, Poses]:
    """Return what a true head sees from the planned poses; its servos stop at the edge, or anywhere, of their play."""
    random = np.random.default_rng([seed, 7])
    azimuth, elevation = random.uniform(-60, 60, room.count) * DEG, random.uniform(-45, 45, room.count) * DEG
    directions = np.column_stack(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    points_m = directions * random.uniform(room.nearest_m, room.furthest_m, room.count)[:, None]
    plants = {name: ServoPlant(joint.servo) for name, joint in truth.joints.items()}
    kinematics, start = Kinematics(truth), default_rig()
    planned = planned_poses(start, PoseParameters())
    view, point, pixels = [], [], []
    for number, pose in enumerate(planned, start=-1):
        for name, plant in plants.items():
            plant.command(pose[name], number + 1.0)
        shafts = np.array([plants[name].step(number + 1.9) for name in JOINT_NAMES])
        if number < 0:
            continue
        if stops_anywhere:
            plays = [truth.joints[name].servo.half_play_rad for name in JOINT_NAMES]
            shafts = np.array([pose[name] for name in JOINT_NAMES]) + random.uniform(-1, 1, 3) * plays
        *pans, tilt = truth.eye_angles(shafts.tolist())
        for eye, pan in enumerate(pans):
            left = eye == 0
            rays = (points_m - kinematics.lens(left, pan, tilt)) @ kinematics.rotation_rig_from_camera(left, pan, tilt)
            camera = CameraModel(truth.camera(left))
            placed = camera.ray_to_pixel(rays)
            inside = np.flatnonzero(camera.contains(np.nan_to_num(placed, nan=-99.0)))
            inside = inside[random.random(len(inside)) < SEEN_SHARE]
            seen = placed[inside] + random.normal(0, NOISE_PX, (len(inside), 2))
            wrong = random.random(len(inside)) < WRONG_SHARE
            seen[wrong] += random.normal(0, 20, (int(wrong.sum()), 2))
            view += [2 * number + eye] * len(inside)
            point += inside.tolist()
            pixels.append(seen)
    views, points = np.array(view), np.array(point)
    often = np.bincount(points)[points] >= 3
    _, points = np.unique(points[often], return_inverse=True)
    joints = [[pose[name] for name in JOINT_NAMES] for pose in planned]
    return Observations(views[often], points, np.vstack(pixels)[often]), visited(start, joints[1:], joints[0])


def cameras_of(rig: Rig, calibrated: bool = False) -> dict[str, EyeCamera]:
    return {eye: EyeCamera(CameraModel(rig.camera(eye == "left")), calibrated) for eye in EYES}


def errors(found: FoundGeometry, truth: Rig) -> Mapping[str, tuple[float, float]]:
    """Return errors and standard deviations of what was found, by name."""
    compared: dict[str, tuple[float, float]] = {}
    for eye in EYES:
        left = eye == "left"
        mount, joint, camera = truth.mount(left), truth.joints[f"pan_{eye}"], truth.camera(left)
        true = {
            "lens_x_m": mount.lens_x_m,
            "lens_y_m": mount.lens_y_m,
            "roll_rad": mount.roll_rad,
            "pitch_rad": mount.pitch_rad,
            "zero_rad": joint.zero_rad,
            "scale": joint.scale,
            "log_focal": math.log(camera.fx_px / found.cameras[eye].model.fx_px),
            "cx_px": camera.cx_px,
            "cy_px": camera.cy_px,
        }
        compared |= {
            f"{eye}.{name}": (found.of(name, eye)[0] - value, found.of(name, eye)[1]) for name, value in true.items()
        }
    for name in ("tilt_axis_x_m", "tilt_axis_z_m"):
        compared[name] = found.of(name)[0] - getattr(truth, name), found.of(name)[1]
    compared["tilt_scale"] = found.of("tilt_scale")[0] - truth.tilt.scale, found.of("tilt_scale")[1]
    return compared


MOST = {
    "lens_x_m": 0.001,
    "lens_y_m": 0.001,
    "roll_rad": 0.1 * DEG,
    "pitch_rad": 0.1 * DEG,
    "zero_rad": 0.1 * DEG,
    "scale": 0.005,
    "log_focal": 0.003,
    "cx_px": 1.5,
    "cy_px": 1.5,
    "tilt_axis_x_m": 0.002,
    "tilt_axis_z_m": 0.002,
    "tilt_scale": 0.005,
}


@pytest.fixture(scope="module")
def found_uncalibrated() -> tuple[FoundGeometry, Rig]:
    truth = printed_rig(1)
    seen, poses = sightings(truth, Room(), 1)
    start = replace(default_rig(), left_camera=default_rig().left_camera.replaced(fx_px=590.0, fy_px=590.0))
    return solved(start, cameras_of(start), poses, seen), truth


def test_a_head_with_cameras_without_calibration_is_found(found_uncalibrated: tuple[FoundGeometry, Rig]) -> None:
    found, truth = found_uncalibrated
    for name, (error, sigma) in errors(found, truth).items():
        assert abs(error) < MOST[name.rpartition(".")[2]], (name, error)
        assert abs(error) < 4 * sigma, (name, error, sigma)
    assert found.residual_before_px > 5
    assert found.residual_px < 0.6
    assert found.kept == ()


def ray_of(rig: Rig, left: bool, joints: list[float], pixel: Array) -> tuple[Array, Array]:
    """Return the lens (3,) and the unit ray (3,) of a pixel (1, 2), as a description of the head has them."""
    kinematics, (pan_left, pan_right, tilt) = Kinematics(rig), rig.eye_angles(joints)
    pan = pan_left if left else pan_right
    flat = CameraModel(rig.camera(left)).undistort(pixel)[0]
    ray = kinematics.rotation_rig_from_camera(left, pan, tilt) @ np.array([*flat, 1.0])
    return kinematics.lens(left, pan, tilt), ray / np.linalg.norm(ray)


def distance_of(rig: Rig, joints: list[float], pixels: dict[bool, Array]) -> float:
    """Return how far from the head the rays of both eyes' pixels meet, nearly [m]."""
    rays = [ray_of(rig, left, joints, pixel) for left, pixel in pixels.items()]
    across = [np.eye(3) - np.outer(ray, ray) for _, ray in rays]
    meet = np.linalg.solve(sum(across), sum(a @ lens for a, (lens, _) in zip(across, rays, strict=True)))
    return float(np.linalg.norm(meet))


def test_distances_are_as_uncertain_as_the_pans_are_said_to_be(found_uncalibrated: tuple[FoundGeometry, Rig]) -> None:
    found, truth = found_uncalibrated
    random, ratios = np.random.default_rng(5), []
    for _ in range(100):
        pan, tilt, distance_m = random.uniform((-0.5, -0.3, 0.4), (0.5, 0.3, 1.5))
        direction = np.array([math.cos(pan) * math.cos(tilt), math.sin(pan) * math.cos(tilt), -math.sin(tilt)])
        joints = list(truth.joint_angles([pan + 0.03, pan - 0.03, tilt]))
        pixels = {}
        for left in (True, False):
            kinematics, (pan_left, pan_right, tilted) = Kinematics(truth), truth.eye_angles(joints)
            at = (left, pan_left if left else pan_right, tilted)
            seen = (distance_m * direction - kinematics.lens(*at)) @ kinematics.rotation_rig_from_camera(*at)
            pixels[left] = CameraModel(truth.camera(left)).ray_to_pixel(seen[None])
        true_m, found_m = (distance_of(rig, joints, pixels) for rig in (truth, found.rig))
        vergence_error_rad = (found_m / true_m - 1.0) * truth.baseline_m / true_m
        ratios.append(vergence_error_rad / (math.sqrt(2.0) * found.rig.zero_sigma_rad))
    # Sightings that are drawn one by one have no errors in common, for which the standard deviations allow.
    assert 0.2 < math.sqrt(float(np.mean(np.square(ratios)))) < 2.0


def test_it_is_written_and_read_back(found_uncalibrated: tuple[FoundGeometry, Rig], tmp_path) -> None:
    found, truth = found_uncalibrated
    path = tmp_path / "rig.yaml"
    path.write_text(rig_text(found.rig, geometry_record(found), "now"))
    assert load_rig(path) == found.rig
    record = yaml.safe_load(path.read_text())["identified"]["geometry"]
    assert record["left"]["lens_x_m"] == pytest.approx(truth.left_mount.lens_x_m, abs=0.001)
    assert 0 < record["left"]["lens_x_m_sigma"] < 0.001
    assert record["right"]["focal_length_px"] == pytest.approx(truth.right_camera.fx_px, rel=0.003)
    again = rig_text(found.rig, recorded(str(path)) | {"assumption": "stamps"}, "later")
    assert yaml.safe_load(again)["identified"] == {"geometry": record, "assumption": "stamps", "at": "later"}
    assert recorded("") == {}
    text = "\n".join(geometry_lines(found))
    assert f"scale {found.of('scale', 'left')[0]:.4f}" in text
    assert "tilt zero" in text


def test_servos_that_stop_anywhere_in_their_play_cost_little() -> None:
    truth = printed_rig(6)
    seen, poses = sightings(truth, Room(), 6, stops_anywhere=True)
    found = solved(default_rig(), cameras_of(default_rig()), poses, seen)
    for name, (error, sigma) in errors(found, truth).items():
        assert abs(error) < 4 * sigma, (name, error, sigma)
        allowed = {"zero_rad": 0.2 * DEG, "scale": 0.01, "tilt_scale": 0.01}.get(
            name.rpartition(".")[2], MOST[name.rpartition(".")[2]]
        )
        assert abs(error) < allowed, (name, error)


def test_calibrated_cameras_are_kept() -> None:
    truth = printed_rig(2)
    seen, poses = sightings(truth, Room(), 2)
    start = replace(default_rig(), left_camera=truth.left_camera, right_camera=truth.right_camera)
    pixels = seen.pixels.copy()
    cameras = cameras_of(start, calibrated=True)
    for number, eye in enumerate(EYES):
        mine, model = seen.view % 2 == number, cameras[eye].model
        pixels[mine] = model.undistort(pixels[mine]) * (model.fx_px, model.fy_px) + (model.cx_px, model.cy_px)
    found = solved(start, cameras, poses, Observations(seen.view, seen.point, pixels))
    assert found.rig.left_camera == truth.left_camera
    assert found.sigmas[index("log_focal", "left")] == 0
    for name, (error, _) in errors(found, truth).items():
        assert abs(error) < MOST[name.rpartition(".")[2]], (name, error)
    assert "not calibrated" not in "\n".join(geometry_lines(found))
    assert "focal_length_px" not in geometry_record(found)["geometry"]["left"]


def test_a_scene_without_depth_is_refused() -> None:
    truth = printed_rig(3)
    seen, poses = sightings(truth, Room(nearest_m=40.0, furthest_m=80.0), 3)
    with pytest.raises(
        IdentifyError, match=r"lens_._m of the (left|right) eye must be found to .* turn the head to things"
    ):
        solved(default_rig(), cameras_of(default_rig()), poses, seen)


def test_what_moves_by_itself_is_refused() -> None:
    truth = printed_rig(4)
    seen, poses = sightings(truth, Room(count=300), 4)
    strayed = np.random.default_rng(0).normal(0, 60, seen.pixels.shape)
    with pytest.raises(IdentifyError, match=r"the head must explain|must be found to"):
        solved(
            default_rig(), cameras_of(default_rig()), poses, Observations(seen.view, seen.point, seen.pixels + strayed)
        )


@pytest.mark.parametrize(
    ("joints", "signs", "reason"),
    [
        ([1, 0, 2], [1, 1, 1], "pan_left must turn as joint_states say, .* are the servos or the cameras swapped"),
        ([0, 1, 2], [-1, -1, 1], "pan_left must turn by 0.5 to 2 times what joint_states say: got -"),
    ],
)
def test_joints_that_turn_otherwise_than_reported_are_named(joints: list[int], signs: list[int], reason: str) -> None:
    seen, poses = sightings(printed_rig(7), Room(count=400), 7)
    reported = Poses(poses.joints_rad[:, joints] * signs, poses.arrived[:, joints] * signs)
    with pytest.raises(IdentifyError, match=reason):
        solved(default_rig(), cameras_of(default_rig()), reported, seen)


def test_a_start_that_is_far_off_is_good_enough() -> None:
    truth = printed_rig(8)
    horns = [replace(truth.joints[f"pan_{eye}"], zero_rad=off * DEG) for eye, off in zip(EYES, (10, -10), strict=True)]
    truth = replace(truth, joints=Joints(horns[0], horns[1], truth.tilt))
    seen, poses = sightings(truth, Room(), 8)
    cameras = [camera.replaced(fx_px=700.0, fy_px=700.0) for camera in (default_rig().left_camera,) * 2]
    start = replace(default_rig(), left_camera=cameras[0], right_camera=cameras[1])
    for name, (error, _) in errors(solved(start, cameras_of(start), poses, seen), truth).items():
        assert abs(error) < MOST[name.rpartition(".")[2]], (name, error)


class StaringHead:
    """A head whose eyes see one picture, whatever the joints do."""

    def __init__(self, pictures: Mapping[str, np.ndarray]) -> None:
        self.pictures = pictures
        self.looks = 0

    def cameras(self) -> Mapping[str, EyeCamera]:
        return cameras_of(default_rig())

    def look(self, joints_rad: Mapping[str, float]) -> Look:
        self.looks += 1
        sizes = {eye: (picture.shape[1], picture.shape[0]) for eye, picture in self.pictures.items()}
        return Look([joints_rad[name] for name in JOINT_NAMES], self.pictures, sizes)


def test_a_view_without_texture_is_refused() -> None:
    blank = np.full((120, 160), 100, np.uint8)
    head = StaringHead(dict.fromkeys(EYES, blank))
    with pytest.raises(IdentifyError, match="features for the geometry: got 0 in the median view"):
        identify_geometry(head, default_rig(), PoseParameters(poses=24))
    assert head.looks == 25


def test_a_calibration_of_another_shape_is_refused() -> None:
    class WideHead(StaringHead):
        def cameras(self) -> Mapping[str, EyeCamera]:
            return cameras_of(default_rig(), calibrated=True)

    wide = np.full((360, 640), 100, np.uint8)
    with pytest.raises(IdentifyError, match="no calibration for images of 640x360 px"):
        identify_geometry(WideHead(dict.fromkeys(EYES, wide)), default_rig(), PoseParameters(poses=24))


# ---- stereo.yaml


def test_the_board_constrains_the_mounts_whatever_the_pans_were() -> None:
    truth = printed_rig(5)
    kinematics = Kinematics(truth)
    vector = np.zeros(100)
    for eye in EYES:
        vector[index("roll_rad", eye)] = truth.mount(eye == "left").roll_rad
        vector[index("pitch_rad", eye)] = truth.mount(eye == "left").pitch_rad
    for pans in ((0.1, 0.2), (-0.3, 0.1)):
        left, right = (kinematics.rotation_rig_from_camera(side, pan, 0.15) for side, pan in zip((True, False), pans))  # noqa: B905
        constraint = mount_constraint(right.T @ left)
        np.testing.assert_allclose(constraint.residuals(vector), 0.0, atol=1e-9)
        off = vector.copy()
        off[index("roll_rad", "right")] += 0.1 * DEG
        assert np.abs(constraint.residuals(off)).max() == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("rotation: {data: [1, 0]}\n", "must have rotation.data, nine numbers"),
        ("rotation: {data: [1, 0, 0, 0, 2, 0, 0, 0, 1]}\n", "must be a rotation matrix"),
        ("[1, 2]\n", "must have rotation.data"),
    ],
)
def test_a_bad_stereo_file_is_named(tmp_path, text: str, reason: str) -> None:
    path = tmp_path / "stereo.yaml"
    path.write_text(text)
    with pytest.raises(IdentifyError, match=reason):
        read_stereo(path)
    with pytest.raises(IdentifyError, match=r"stereo file '.*missing.yaml'"):
        read_stereo(tmp_path / "missing.yaml")


def test_sightings_in_reduced_pictures_are_those_of_whole_images() -> None:
    truth = printed_rig(9)
    seen, _ = sightings(truth, Room(count=100), 9)
    whole = _in_whole_images(seen, (2.0, 1.0), cameras_of(default_rig()))
    left = seen.view % 2 == 0
    np.testing.assert_allclose(whole[left], 2.0 * seen.pixels[left] + 0.5)
    np.testing.assert_allclose(whole[~left], seen.pixels[~left])
    calibrated = cameras_of(truth, calibrated=True)
    straight = _in_whole_images(seen, (1.0, 1.0), calibrated)
    model = calibrated["left"].model
    flat = (straight[left] - (model.cx_px, model.cy_px)) / (model.fx_px, model.fy_px)
    np.testing.assert_allclose(model.distort(flat), seen.pixels[left], atol=1e-6)
