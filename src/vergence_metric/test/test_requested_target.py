"""A point that was asked for: learnt in its own image, found again after the eyes have turned, on rendered boards."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_metric.alignment.alignment import Alignment
from vergence_metric.disparity import make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.tracking.appearance_follower import remembered_patch_tracker
from vergence_metric.tracking.eye_view import EyeView, eye_views
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.remembered_patch import RememberedPatch
from vergence_metric.tracking.request import PairMemory, StoredPair, TrackRequest
from vergence_metric.tracking.track import TrackStatus
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, rotation_rig_from_optical
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig
from vergence_rig.testing.ideal_eyes import eye_position, gaze_for_point

RIG = default_rig()
CAMERA = CameraModel(RIG.left_camera)
K = np.array([[539.0, 0, 319.5], [0, 539.0, 239.5], [0, 0, 1.0]])
FRAME_S = 1 / 30


def texture(seed, shape, sigmas=(1.5, 4.0, 12.0)):
    rng = np.random.default_rng(seed)
    out = sum(cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), s) * s for s in sigmas)
    return np.clip(128 + 45 * (out - out.mean()) / out.std(), 0, 255).astype(np.float32)


WALL = texture(1, (1300, 2000))
BOARD = texture(2, (160, 160))
WALL_M, BOARD_M = 2.0, (0.7, 0.08, 0.03)


def project(point_m, left, eyes):
    pan = eyes.pan_left_rad if left else eyes.pan_right_rad
    ray = rotation_rig_from_optical(pan, eyes.tilt_rad).T @ (np.array(point_m) - eye_position(left, RIG.baseline_m))
    u, v = CAMERA.ray_to_pixel(ray[None])[0]
    return float(u), float(v)


def paste(image, surface, center_m, width_m, left, eyes):
    per_px = width_m / surface.shape[1]
    right, down = np.array([0.0, -per_px, 0.0]), np.array([0.0, 0.0, -per_px])
    corner = np.array(center_m) - right * (surface.shape[1] - 1) / 2 - down * (surface.shape[0] - 1) / 2
    columns = np.column_stack([right, down, corner - eye_position(left, RIG.baseline_m)])
    pan = eyes.pan_left_rad if left else eyes.pan_right_rad
    homography = K @ rotation_rig_from_optical(pan, eyes.tilt_rad).T @ columns
    cv2.warpPerspective(surface, homography, (640, 480), dst=image, borderMode=cv2.BORDER_TRANSPARENT)


def view(left, eyes, board_m=BOARD_M, gain=1.0):
    """Both images of a board before a wall, as an eye at these angles sees them."""
    image = np.full((480, 640), 90, np.float32)
    paste(image, WALL, (WALL_M, 0.0, 0.0), 5.0, left, eyes)
    if board_m is not None:
        paste(image, BOARD, board_m, 0.12, left, eyes)
    image = gain * image + 2.0 * cv2.randn(np.empty((480, 640), np.float32), 0, 1)
    return np.clip(image, 0, 255).astype(np.uint8)


def views(eyes):
    return eye_views(CAMERA, eyes, Kinematics(RIG))


AHEAD = EyeAngles(0.0, 0.0, 0.0)


class Stage:
    """A tracker that sees pair after pair and keeps those pairs."""

    def __init__(self, **parameters):
        cv2.setRNGSeed(1)
        estimator = make_estimator(DisparityParameters())
        self.tracker = remembered_patch_tracker(TrackerParameters(**parameters), estimator, CAMERA, Kinematics(RIG))
        self.memory, self.stamp_s = PairMemory(1.0), 0.0

    def show(self, eyes, reported=None, board_m=BOARD_M):
        self.stamp_s += FRAME_S
        left, right = view(True, eyes, board_m), view(False, eyes, board_m, gain=0.9)
        reported = reported or eyes
        self.memory.add(StoredPair(self.stamp_s, left, right, views(reported)))
        return self.tracker.update(left, right, self.stamp_s, reported)

    def ask(self, point_m, eyes, left_eye=True):
        pair = self.memory.nearest(self.stamp_s, 0.1)
        assert pair is not None
        self.tracker.request(TrackRequest(5, self.stamp_s, left_eye, project(point_m, left_eye, eyes)), pair)


def turned(eyes, pan_deg, tilt_deg):
    pan, tilt = math.radians(pan_deg), math.radians(tilt_deg)
    return EyeAngles(eyes.pan_left_rad + pan, eyes.pan_right_rad + pan, eyes.tilt_rad + tilt)


ASIDE_M = (BOARD_M[0], BOARD_M[1] + 0.03, BOARD_M[2] - 0.02)


@pytest.mark.parametrize("wrong_deg", [(0.0, 0.0), (0.8, -0.7), (-1.5, 1.0)])
def test_the_clicked_point_is_found_after_a_saccade_whose_joints_are_reported_wrong(wrong_deg):
    stage = Stage()
    stage.show(AHEAD)
    stage.ask(ASIDE_M, AHEAD)
    landed = gaze_for_point(np.array(ASIDE_M), RIG.baseline_m)
    really = turned(landed, *wrong_deg)
    for _ in range(3):
        track = stage.show(really, reported=landed)
    assert (track.status, track.goal_id) == (TrackStatus.OK, 5), track.reason
    true_left, true_right = project(ASIDE_M, True, really), project(ASIDE_M, False, really)
    np.testing.assert_allclose(track.left_px, true_left, atol=1.0)
    assert track.disparity_px == pytest.approx(true_left[0] - true_right[0], abs=0.5)


def test_a_jump_that_the_joints_report_a_pair_late_does_not_lose_the_point():
    """The next pair is searched about where the late report puts the point: as far away again, on the other side."""
    stage = Stage()
    stage.show(AHEAD)
    stage.ask(ASIDE_M, AHEAD)
    landed = gaze_for_point(np.array(ASIDE_M), RIG.baseline_m)
    for _ in range(4):
        stage.show(landed)
    beside = turned(landed, -2.4, 2.2)
    stage.show(beside, reported=landed)
    for _ in range(6):
        track = stage.show(beside)
        np.testing.assert_allclose(track.left_px, project(ASIDE_M, True, beside), atol=1.0)
    assert track.status is TrackStatus.OK


def test_a_point_clicked_in_the_right_image_is_the_same_point():
    stage = Stage()
    stage.show(AHEAD)
    stage.ask(ASIDE_M, AHEAD, left_eye=False)
    track = stage.show(AHEAD)
    np.testing.assert_allclose(track.left_px, project(ASIDE_M, True, AHEAD), atol=1.5)


def test_whatever_lies_at_the_fovea_is_not_the_target():
    stage = Stage()
    stage.show(AHEAD)
    stage.ask(ASIDE_M, AHEAD)
    elsewhere = turned(AHEAD, -20.0, 0.0)
    tracks = [stage.show(elsewhere) for _ in range(30)]
    assert {track.goal_id for track in tracks} == {5}
    inside = [track for track in tracks if track.status is TrackStatus.OK]
    true = project(ASIDE_M, True, elsewhere)
    assert all(np.hypot(*np.subtract(track.left_px, true)) < 3.0 for track in inside)


def test_a_target_that_is_gone_is_lost_for_as_long_as_it_is():
    stage = Stage()
    stage.show(AHEAD)
    stage.ask(BOARD_M, AHEAD)
    assert stage.show(AHEAD).status is TrackStatus.OK
    tracks = [stage.show(AHEAD, board_m=None) for _ in range(120)]
    assert {track.status for track in tracks[2:]} == {TrackStatus.LOST}
    assert {track.goal_id for track in tracks} == {5}
    assert stage.show(AHEAD).status is TrackStatus.OK


def test_a_moving_target_is_followed_not_its_surroundings():
    stage = Stage()
    stage.show(AHEAD)
    stage.ask(BOARD_M, AHEAD)
    place = np.array(BOARD_M)
    for _ in range(40):
        place = place - np.array([0.0, 0.004, 0.0])
        track = stage.show(AHEAD, board_m=tuple(place))
    assert track.status is TrackStatus.OK, track.reason
    np.testing.assert_allclose(track.left_px, project(place, True, AHEAD), atol=4.0)


def test_drift_is_put_right():
    stage = Stage()
    stage.show(AHEAD)
    stage.ask(BOARD_M, AHEAD)
    stage.show(AHEAD)
    target = stage.tracker.target
    assert target is not None
    x, y = target.appearance.pixel
    target.appearance.pixel = (x + 3.0, y - 2.0)
    for _ in range(3):
        track = stage.show(AHEAD)
    np.testing.assert_allclose(track.left_px, project(BOARD_M, True, AHEAD), atol=0.7)


def test_without_a_request_it_locks_on_the_fovea_again():
    stage = Stage()
    stage.show(AHEAD)
    stage.ask(BOARD_M, AHEAD)
    stage.show(AHEAD)
    stage.tracker.lock_here()
    tracks = [stage.show(AHEAD) for _ in range(12)]
    assert (tracks[-1].status, tracks[-1].goal_id) == (TrackStatus.OK, 0), tracks[-1].reason


def test_a_patch_at_the_corner_of_its_image_is_matched_by_what_the_image_shows():
    image = view(True, AHEAD)
    corner = (12.0, 15.0)
    patch = RememberedPatch(image, views(AHEAD)[0], corner)
    eyes = turned(AHEAD, 12.0, -8.0)
    view_now = views(eyes)[0]
    found = patch.find(view(True, eyes), view_now, patch.direction, 30)
    assert found is not None
    np.testing.assert_allclose(found.pixel, view_now.pixel(patch.direction), atol=1.5)


def test_a_patch_predicted_outside_the_image_is_not_looked_for():
    patch = RememberedPatch(view(True, AHEAD), views(AHEAD)[0], (320.0, 240.0))
    eyes = turned(AHEAD, 60.0, 0.0)
    assert patch.find(view(True, eyes), views(eyes)[0], patch.direction, 30) is None


def test_a_patch_without_texture_is_found_nowhere():
    blank = np.full((480, 640), 120, np.uint8)
    patch = RememberedPatch(blank, views(AHEAD)[0], (320.0, 240.0))
    assert patch.find(blank, views(AHEAD)[0], patch.direction, 30) is None


def stored(stamp_s):
    blank = np.zeros((4, 4), np.uint8)
    return StoredPair(stamp_s, blank, blank, views(AHEAD))


def test_the_memory_holds_its_time_and_gives_the_nearest():
    memory = PairMemory(1.0)
    for stamp_s in np.arange(0.0, 3.01, 0.1):
        memory.add(stored(float(stamp_s)))
    nearest = memory.nearest(2.46, 0.1)
    assert nearest is not None
    assert nearest.stamp_s == pytest.approx(2.5)
    assert memory.nearest(1.0, 0.1) is None
    memory.add(stored(0.5))
    assert memory.nearest(3.0, 0.1) is None


@given(st.floats(-20, 20), st.floats(-0.1, 0.1), st.floats(0, 639), st.floats(0, 479))
def test_aligned_is_the_inverse_of_unaligned(vertical_px, roll_rad, x, y):
    alignment = Alignment("calibrated", vertical_px, roll_rad)
    there = alignment.unaligned(*alignment.aligned(x, y, 640, 480), 640, 480)
    np.testing.assert_allclose(there, (x, y), atol=1e-9)


def striped(seed):
    """A wall of level stripes, with an upright edge far to the left: along the stripes every place looks alike."""
    rows = cv2.GaussianBlur(
        np.random.default_rng(seed).standard_normal((1300, 1)).astype(np.float32), (1, 0), 0, None, 4
    )
    wall = np.repeat(128 + 60 * (rows - rows.mean()) / rows.std(), 2000, axis=1)
    wall[:, :850] = texture(seed, (1300, 850))
    return np.clip(wall, 0, 255).astype(np.float32)


def test_along_an_edge_the_wide_view_says_where_the_point_is():
    rng, image = np.random.default_rng(3), striped(4)
    place = np.array([930.0, 650.0])  # 80 px right of the textured part

    def seen(corner):
        x, y = np.round(corner).astype(int)
        noisy = image[y : y + 480, x : x + 640] + rng.normal(0.0, 2.0, (480, 640))
        return np.clip(noisy, 0, 255).astype(np.uint8)

    before, view_before = seen(place - (320, 240)), EyeView(CAMERA, 0.0, 0.0)
    patch = RememberedPatch(before, view_before, (320.0, 240.0))
    for moved in ((9, 0), (-12, 4), (14, -6)):
        found = patch.find(seen(place - (320, 240) - moved), view_before, patch.direction, 24)
        assert found is not None
        assert found.pixel == pytest.approx((320.0 + moved[0], 240.0 + moved[1]), abs=2.5)


def test_joints_that_report_no_move_leave_the_point_where_it_was():
    """Servos rest: what looks alike beside the point is not it, however long it is followed."""
    stage = Stage()
    stage.show(AHEAD)
    stage.ask(ASIDE_M, AHEAD)
    tracks = [stage.show(AHEAD) for _ in range(40)]
    places = np.array([track.left_px for track in tracks])
    assert np.abs(places - project(ASIDE_M, True, AHEAD)).max() < 1.0


def test_a_repeated_texture_is_ambiguous_and_names_its_distances():
    """A wall of equal tiles fits at several distances: the track says so and lists them."""
    tile = texture(7, (130, 40), sigmas=(1.5, 4.0))
    row = np.tile(tile, (10, 40))

    def seen(shift_px):
        noise = np.random.default_rng(shift_px).normal(0.0, 2.0, (480, 640))
        return np.clip(row[200:680, 300 + shift_px : 940 + shift_px] + noise, 0, 255).astype(np.uint8)

    left, right = seen(0), seen(23)
    stage = Stage()
    pair = StoredPair(0.1, left, right, views(AHEAD))
    stage.tracker.request(TrackRequest(5, 0.1, True, (320.0, 240.0)), pair)
    tracks = [stage.tracker.update(left, right, 0.1 + FRAME_S * n, AHEAD) for n in range(1, 20)]
    assert {track.status for track in tracks[3:]} == {TrackStatus.AMBIGUOUS}, tracks[-1]
    found = [disparity_px for disparity_px, _ in tracks[-1].candidates]
    assert sum(min(abs(d - 23 - 40 * k) for k in range(-4, 4)) < 2.0 for d in found) >= 2


def shaded(seed):
    """An image of strong shades that repeat along a row, with what tells the places apart only faintly drawn."""
    columns = 60.0 * np.sin(2 * math.pi * np.arange(640) / 16.0)
    return 128.0 + np.tile(columns, (480, 1)) + 4.0 * (texture(seed, (480, 640)) - 128.0) / 45.0


def with_noise(image, seed):
    noisy = image + 2.0 * np.random.default_rng(seed).standard_normal(image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def test_a_place_that_explains_more_is_the_place_however_alike_the_others_are():
    image = shaded(3)
    eye = EyeView(CAMERA, 0.0, 0.0)
    patch = RememberedPatch(with_noise(image, 1), eye, (320.0, 240.0))
    moved = np.roll(image, (5, 9), axis=(0, 1))
    found = patch.find(with_noise(moved, 2), eye, patch.direction, 40)
    assert found is not None
    np.testing.assert_allclose(found.pixel, (329.0, 245.0), atol=0.5)
    assert found.spread_px <= 4.0


def test_a_point_without_texture_stays_where_its_surroundings_are():
    flat = texture(4, (480, 640))
    flat[200:281, 280:361] = 128.0
    left_view, right_view = views(AHEAD)
    tracker = remembered_patch_tracker(
        TrackerParameters(), make_estimator(DisparityParameters()), CAMERA, Kinematics(RIG)
    )
    request = TrackRequest(5, 0.0, True, (320.0, 240.0))
    first = StoredPair(0.0, with_noise(flat, 1), with_noise(flat, 2), (left_view, right_view))
    tracker.update(first.left, first.right, 0.0, AHEAD)
    tracker.request(request, first)
    for i in range(1, 30):
        left, right = with_noise(flat, 2 * i + 1), with_noise(flat, 2 * i + 2)
        track = tracker.update(left, right, i * FRAME_S, AHEAD)
        np.testing.assert_allclose(track.left_px, (320.0, 240.0), atol=2.0)


@pytest.mark.parametrize("moved", [(0, 0), (2, -1), (4, 3), (9, -6), (-14, 3)])
def test_a_point_is_found_though_the_eye_has_moved_and_reports_none(moved):
    scene = texture(12, (480, 640))
    eye = EyeView(CAMERA, 0.0, 0.0)
    patch = RememberedPatch(with_noise(scene, 1), eye, (320.0, 240.0))
    found = patch.find(with_noise(np.roll(scene, moved[::-1], axis=(0, 1)), 2), eye, patch.direction, 4)
    assert found is not None
    np.testing.assert_allclose(found.pixel, (320.0 + moved[0], 240.0 + moved[1]), atol=0.5)
    assert found.similarity > 0.9


def test_along_an_edge_the_place_stays_where_it_is_expected_pair_after_pair():
    """What is reduced has no place exactly at the expected one: half a place too far a pair adds up."""
    bars = np.tile(texture(6, (1, 640), sigmas=(3.0, 9.0)), (480, 1))
    eye = EyeView(CAMERA, 0.0, 0.0)
    patch = RememberedPatch(with_noise(bars, 0), eye, (320.0, 240.0))
    direction = patch.direction
    for pair in range(1, 25):
        found = patch.find(with_noise(bars, pair), eye, direction, 4)
        assert found is not None
        direction = eye.direction(found.pixel)
    np.testing.assert_allclose(eye.pixel(direction), (320.0, 240.0), atol=3.0)


def test_along_a_bright_pole_the_place_is_known_by_the_dark_room_beside_it():
    room = 14.0 + 3.0 * (texture(8, (600, 640), sigmas=(6.0,)) - 128.0) / 45.0

    def seen(down_px, seed):
        image = room[60 - down_px : 540 - down_px].copy()
        for row in range(480):
            first = round(300.0 + 0.12 * (row - down_px))
            image[row, first : first + 40] = 235.0
        return with_noise(image, seed)

    eye = EyeView(CAMERA, 0.0, 0.0)
    patch = RememberedPatch(seen(0, 1), eye, (340.0, 240.0))
    found = patch.find(seen(14, 2), eye, patch.direction, 24)
    assert found is not None
    np.testing.assert_allclose(found.pixel, (340.0, 254.0), atol=2.0)


@pytest.mark.parametrize("moved", [(9, 9), (12, -6), (-14, 3)])
def test_what_stands_before_surroundings_that_are_found_is_looked_for_by_itself(moved):
    """A lens that lies off its axis has moved: the board is no longer where its surroundings are."""
    wall, board = texture(11, (480, 640)), texture(50, (41, 33))

    def seen(across_px, down_px, seed):
        image = wall.copy()
        image[220 + down_px : 261 + down_px, 304 + across_px : 337 + across_px] = board
        return with_noise(image, seed)

    eye = EyeView(CAMERA, 0.0, 0.0)
    patch = RememberedPatch(seen(0, 0, 1), eye, (320.0, 240.0))
    found = patch.find(seen(moved[0], moved[1], 2), eye, patch.direction, 24, alone_below=0.6)
    assert found is not None
    np.testing.assert_allclose(found.pixel, (320.0 + moved[0], 240.0 + moved[1]), atol=1.0)
    lost = patch.find(with_noise(wall, 3), eye, patch.direction, 24, alone_below=0.6)
    assert lost is not None
    assert lost.at_point < 0.5
