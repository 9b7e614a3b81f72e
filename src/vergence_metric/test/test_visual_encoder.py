"""The visual encoder on pictures of a room drawn by ray casting: right within its stated deviation, or refused."""

import math
from functools import lru_cache

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.eye_rotation.encoder import EyeRotationReading, EyeRotationStatus, VisualEncoder
from vergence_metric.eye_rotation.epipolar_view import epipolar_view
from vergence_metric.eye_rotation.parameters import AcceptanceParameters, EncoderParameters, MatchingParameters
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, rotation_rig_from_eye
from vergence_rig.rig import default_rig
from vergence_rig.servo import IDEAL, SG90

RIG = default_rig().with_servos(SG90)
BASELINE_M = RIG.baseline_m
CAMERA = CameraModel.from_camera_info_values(640, 480, [539, 0, 319.5, 0, 539, 239.5, 0, 0, 1], [-0.04, 0.02, 0, 0, 0])
MODELS = (CAMERA, CAMERA)
WALLS_M = ((-1.0, 2.6), (-1.4, 1.8), (-0.9, 1.1))
"""The room: from behind to ahead, from right to left, from floor to ceiling."""
TEXELS_PER_M = 260.0


@lru_cache(maxsize=8)
def texture(seed: int) -> np.ndarray:
    """A wall (h, w) uint8: patches of all sizes."""
    random = np.random.default_rng(seed)
    wall = np.full((1000, 1000), 110, np.uint8)
    for _ in range(1500):
        centre, axes = random.integers(0, 1000, 2).tolist(), random.integers(3, 40, 2).tolist()
        cv2.ellipse(wall, centre, axes, float(random.uniform(0, 180)), 0, 360, int(random.integers(20, 236)), -1)
    return cv2.GaussianBlur(wall, (0, 0), 1.2)


@lru_cache(maxsize=1)
def camera_rays() -> np.ndarray:
    x, y = np.meshgrid(np.arange(640.0), np.arange(480.0))
    rays = CAMERA.pixel_to_ray(np.column_stack([x.ravel(), y.ravel()]))
    return np.column_stack([rays[:, 2], -rays[:, 0], -rays[:, 1]])


def view(left: bool, pan_rad: float, noise: float = 0.0, mount: np.ndarray | None = None, seed: int = 0) -> np.ndarray:
    """What an eye sees of the room and of a board half a metre ahead: (480, 640) uint8."""
    turn = rotation_rig_from_eye(pan_rad, 0.0) if mount is None else rotation_rig_from_eye(pan_rad, 0.0) @ mount
    rays = camera_rays() @ turn.T
    place = np.array([0.0, (0.5 if left else -0.5) * BASELINE_M, 0.0])
    walls = [(axis, bound) for axis, bounds in enumerate(WALLS_M) for bound in bounds]
    picture = np.zeros(len(rays), np.uint8)
    nearest = np.full(len(rays), np.inf)
    for number, (axis, bound) in enumerate([*walls, (0, 0.5)]):
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (bound - place[axis]) / rays[:, axis]
        distance[~(distance > 0)] = np.inf
        points = place + rays * np.where(np.isfinite(distance), distance, 0.0)[:, None]
        if number == len(walls):
            distance[(np.abs(points[:, 1:]) > (0.06, 0.05)).any(axis=1)] = np.inf
        across = [other for other in range(3) if other != axis]
        uv = (points[:, across] * TEXELS_PER_M + 500.0).astype(np.float32).reshape(480, 640, 2)
        drawn = cv2.remap(texture(number), uv[..., 0], uv[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        nearer = distance < nearest
        picture[nearer] = drawn.ravel()[nearer]
        nearest = np.minimum(nearest, distance)
    random = np.random.default_rng(seed + 2 * left)
    return np.clip(picture + random.normal(0.0, noise, picture.shape) + 0.5, 0, 255).astype(np.uint8).reshape(480, 640)


MOUNT = rotation_rig_from_eye(0.0, 0.009) @ np.array(
    [[1, 0, 0], [0, math.cos(0.006), -math.sin(0.006)], [0, math.sin(0.006), math.cos(0.006)]]
)


def read(
    true: tuple[float, float],
    said: tuple[float, float],
    noise: float = 2.5,
    parameters: EncoderParameters | None = None,
) -> EyeRotationReading:
    left, right = view(True, true[0], noise), view(False, true[1], noise, MOUNT)
    encoder = VisualEncoder(parameters or EncoderParameters(), RIG)
    return encoder.measure(left, right, EyeAngles(*said, 0.0), MODELS)


@pytest.mark.parametrize(("version", "vergence"), [(0.0, 0.06), (0.35, 0.12), (-0.2, 0.02)])
def test_true_vergence_is_read_where_the_joints_are_off(version: float, vergence: float) -> None:
    true = (version - 0.5 * vergence, version + 0.5 * vergence)
    reading = read(true, (true[0] + 0.006, true[1] - 0.004))
    assert reading.ok, reading.reason
    assert reading.rotation is not None
    assert math.degrees(reading.rotation.vergence_rad - vergence) == pytest.approx(0.0, abs=0.05)
    assert reading.joint_vergence_rad == pytest.approx(vergence - 0.01)
    # Both rolls have the same effect: depth determines only their difference.
    _, right_roll, right_pitch, _, left_roll = reading.rotation.corrections_rad
    assert right_roll - left_roll == pytest.approx(0.006, abs=5e-4)
    assert right_pitch == pytest.approx(0.009, abs=1e-3)
    assert reading.residual_px < 0.2


@settings(deadline=None, max_examples=10)
@given(
    version=st.floats(-0.4, 0.4),
    vergence=st.floats(0.0, 0.18),
    off=st.tuples(st.floats(-0.009, 0.009), st.floats(-0.009, 0.009)),
)
def test_any_pans_inside_the_dead_band_are_read_within_the_stated_deviation(
    version: float, vergence: float, off: tuple[float, float]
) -> None:
    true = (version - 0.5 * vergence, version + 0.5 * vergence)
    reading = read(true, (true[0] + off[0], true[1] + off[1]))
    assert reading.ok, reading.reason
    assert reading.rotation is not None
    assert abs(reading.rotation.vergence_rad - vergence) < 4.0 * reading.rotation.sigma_rad < math.radians(0.4)


def test_exposures_of_different_brightness_and_colour_images_give_the_same_reading() -> None:
    left, right = view(True, -0.03, 2.0), view(False, 0.03, 2.0)
    encoder = VisualEncoder(EncoderParameters(), RIG)
    eyes = EyeAngles(-0.03, 0.03, 0.0)
    bright = np.clip(right * 1.25, 0, 255).astype(np.uint8)
    reading = encoder.measure(
        cv2.cvtColor(left, cv2.COLOR_GRAY2BGR), cv2.cvtColor(bright, cv2.COLOR_GRAY2BGR), eyes, MODELS
    )
    assert reading.ok
    assert reading.rotation is not None
    assert math.degrees(reading.rotation.vergence_rad - 0.06) == pytest.approx(0.0, abs=0.06)


def blank(noise: float) -> np.ndarray:
    return np.clip(np.random.default_rng(1).normal(128, noise, (480, 640)), 0, 255).astype(np.uint8)


def mirrored() -> np.ndarray:
    return np.ascontiguousarray(view(False, 0.03)[::-1, ::-1])


@pytest.mark.parametrize(
    "right",
    [
        blank(0.0),
        blank(3.0),
        np.zeros((480, 640), np.uint8),
        mirrored(),
        cv2.GaussianBlur(view(False, 0.03), (0, 0), 15),
    ],
    ids=["blank", "noise", "black", "unrelated", "blurred"],
)
def test_images_without_matches_are_refused_with_a_reason(right: np.ndarray) -> None:
    reading = VisualEncoder(EncoderParameters(), RIG).measure(
        view(True, -0.03, 2.0), right, EyeAngles(-0.03, 0.03, 0.0), MODELS
    )
    assert not reading.ok
    assert reading.status in (
        EyeRotationStatus.FEW_FEATURES,
        EyeRotationStatus.DISAGREEING,
        EyeRotationStatus.UNCERTAIN,
    )
    assert reading.reason


def test_both_images_blank_is_refused() -> None:
    encoder = VisualEncoder(EncoderParameters(), RIG)
    for image in (blank(0.0), blank(3.0)):
        reading = encoder.measure(image, image.copy()[::-1].copy(), EyeAngles(0.0, 0.0, 0.0), MODELS)
        assert reading.status is EyeRotationStatus.FEW_FEATURES


def test_a_vergence_that_servos_and_mounts_cannot_have_is_contradictory() -> None:
    encoder = VisualEncoder(
        EncoderParameters(acceptance=AcceptanceParameters(mount_tolerance_rad=0.004)), RIG.with_servos(IDEAL)
    )
    reading = encoder.measure(view(True, -0.03), view(False, 0.03), EyeAngles(-0.03, 0.022, 0.0), MODELS)
    assert reading.status is EyeRotationStatus.CONTRADICTORY
    assert "0.46 degrees" in reading.reason
    assert "0.23" in reading.reason


def test_joints_that_are_far_off_are_never_confirmed() -> None:
    for off in (-0.08, 0.08):
        assert not read((-0.03, 0.03), (-0.03, 0.03 + off)).ok


def test_features_in_one_corner_are_too_uncertain() -> None:
    left, right = view(True, -0.03), view(False, 0.03)
    covered = np.zeros_like(left)
    covered[180:300, 220:420] = 1
    parameters = EncoderParameters(
        matching=MatchingParameters(features=4000),
        acceptance=AcceptanceParameters(min_inliers=30, max_sigma_rad=0.002),
    )
    encoder = VisualEncoder(parameters, RIG)
    reading = encoder.measure(left * covered, right * covered, EyeAngles(-0.03, 0.03, 0.0), MODELS)
    assert reading.status in (EyeRotationStatus.UNCERTAIN, EyeRotationStatus.FEW_FEATURES)


@settings(deadline=None, max_examples=30)
@given(
    pans=st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9)),
    column=st.floats(20.0, 620.0),
    row=st.floats(60.0, 490.0),
    depth_m=st.floats(0.2, 30.0),
)
def test_a_point_lies_in_one_row_of_both_views_however_near(
    pans: tuple[float, float], column: float, row: float, depth_m: float
) -> None:
    grey = np.zeros((480, 640), np.uint8)
    step = 1.0 / 539.0
    left, right = (epipolar_view(grey, CAMERA, pan, step) for pan in pans)
    flat = left.to_image_plane([[column, row]])[0]
    ray = rotation_rig_from_eye(pans[0], 0.0) @ (1.0, -flat[0], -flat[1])
    point = depth_m * ray / np.linalg.norm(ray) + (0.0, BASELINE_M, 0.0)
    aside = math.asin(point[1] / np.linalg.norm(point))
    right_column = 319.5 + (pans[1] - aside) / step
    seen = right.to_image_plane([[right_column, row]])[0]
    local = rotation_rig_from_eye(pans[1], 0.0).T @ point
    assert seen * local[0] == pytest.approx(-local[1:], abs=1e-9 + 1e-9 * depth_m)


def test_the_view_shows_what_the_lens_saw() -> None:
    grey = view(True, 0.2)
    drawn = epipolar_view(grey, CAMERA, 0.2, 1.0 / 539.0)
    spots = np.column_stack([x.ravel() for x in np.meshgrid(np.arange(60, 580, 37.0), np.arange(80, 470, 29.0))])
    pixels = CAMERA.distort(drawn.to_image_plane(spots)).astype(np.float32)
    seen = cv2.remap(grey, pixels[:, 0].reshape(1, -1), pixels[:, 1].reshape(1, -1), cv2.INTER_CUBIC).ravel()
    columns, rows = spots.astype(int).T
    assert drawn.seen[rows, columns].all()
    assert np.abs(drawn.grey[rows, columns].astype(int) - seen).max() <= 3
