"""The class-free tracker on rendered sequences: two textured boards and a wall, seen by eyes that turn."""

import math

import cv2
import numpy as np
import pytest

from vergence_metric.disparity import make_estimator
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.tracking.parameters import TrackerParameters
from vergence_metric.tracking.track import TrackStatus
from vergence_metric.tracking.tracker import TargetTracker
from vergence_rig.camera import CameraModel
from vergence_rig.geometry import EyeAngles, eye_position, gaze_for_point, rotation_rig_from_optical
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig

RIG = default_rig()
CAMERA = CameraModel(RIG.left_camera)
FRAME_S = 1 / 30
K = np.array([[539.0, 0, 319.5], [0, 539.0, 239.5], [0, 0, 1.0]])


def texture(seed, shape, sigmas):
    rng = np.random.default_rng(seed)
    out = sum(cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), s) * s for s in sigmas)
    return np.clip(128 + 45 * (out - out.mean()) / out.std(), 0, 255).astype(np.float32)


WALL = texture(1, (900, 1400), (2.0, 5.0, 12.0))
TARGET, OTHER = texture(2, (96, 96), (3.0, 6.0)), texture(3, (96, 96), (3.0, 6.0))


def board(image, surface, center_m, size_m, left, eyes, slant_rad=0.0):
    """Draw a board that faces the head, its right side turned away by `slant_rad`; `size_m` is (width, height)."""
    pan = eyes.pan_left_rad if left else eyes.pan_right_rad
    per_px = np.array(size_m) / (surface.shape[1], surface.shape[0])
    right, down = (
        per_px[0] * np.array([math.sin(slant_rad), -math.cos(slant_rad), 0.0]),
        np.array([0.0, 0.0, -per_px[1]]),
    )
    corner = np.array(center_m) - right * (surface.shape[1] - 1) / 2 - down * (surface.shape[0] - 1) / 2
    columns = np.column_stack([right, down, corner - eye_position(left, RIG.baseline_m)])
    homography = K @ rotation_rig_from_optical(pan, eyes.tilt_rad).T @ columns
    cv2.warpPerspective(surface, homography, (640, 480), dst=image, borderMode=cv2.BORDER_TRANSPARENT)


def pixel(point_m, left, eyes):
    pan = eyes.pan_left_rad if left else eyes.pan_right_rad
    ray = rotation_rig_from_optical(pan, eyes.tilt_rad).T @ (np.array(point_m) - eye_position(left, RIG.baseline_m))
    return CAMERA.ray_to_pixel(ray[None])[0]


class Stage:
    """Shows frame after frame to a tracker and keeps what it says beside the truth."""

    def __init__(self):
        self.tracker = TargetTracker(
            TrackerParameters(), make_estimator(DisparityParameters()), CAMERA, Kinematics(RIG)
        )
        self.frame, self.rng = 0, np.random.default_rng(0)
        self.tracks, self.errors = [], []

    def show(self, target_m, eyes, occluder_m=None, covered=(), slant_rad=0.0, joints=None):
        """Show a frame; `joints` are the reported angles, if they differ from the true ones."""
        images = []
        for left in (True, False):
            image = np.full((480, 640), 90, np.float32)
            board(image, WALL, (3.0, 0.0, 0.0), (7.0, 4.5), left, eyes)
            board(image, TARGET, target_m, (0.06, 0.06), left, eyes, slant_rad)
            if occluder_m is not None:
                board(image, OTHER, occluder_m, (0.08, 0.08), left, eyes)
            if ("left" if left else "right") in covered:
                image[:] = 15
            image += 2.0 * cv2.randn(np.empty((480, 640), np.float32), 0, 1)
            images.append(np.clip(image, 0, 255).astype(np.uint8))
        track = self.tracker.update(images[0], images[1], self.frame * FRAME_S, joints or eyes)
        true_left, true_right = pixel(target_m, True, eyes), pixel(target_m, False, eyes)
        self.tracks.append(track)
        self.errors.append(
            (*(np.array(track.left_px) - true_left), track.disparity_px - (true_left[0] - true_right[0]))
        )
        self.frame += 1
        return track

    def lock(self, target_m, eyes):
        for _ in range(12):
            if self.show(target_m, eyes).status is TrackStatus.OK:
                return self.tracks[-1]
        raise AssertionError(f"no lock: {self.tracks[-1].status.name}, {self.tracks[-1].reason}")


def gaze(point_m):
    return gaze_for_point(np.array(point_m), RIG.baseline_m)


@pytest.fixture
def stage():
    cv2.setRNGSeed(1)
    return Stage()


def test_it_locks_on_what_lies_at_the_fovea_once_the_eyes_rest(stage):
    target = (0.7, 0.05, 0.02)
    assert stage.show(target, gaze(target)).status is TrackStatus.LOCKING
    track = stage.lock(target, gaze(target))
    assert track.track_id == 1
    assert track.lock_stamp_s == pytest.approx((stage.frame - 1) * FRAME_S)
    assert np.abs(stage.errors[-1]).max() < 2.0
    assert track.disparity_px == pytest.approx(0.0, abs=0.3)
    size_px = 539 * 0.06 / 0.7
    assert size_px * 0.7 < min(track.extent_px) <= max(track.extent_px) < size_px * 1.5
    assert track.confidence > 0.8


def test_the_right_eye_may_be_parallel(stage):
    target = (0.35, 0.0, 0.0)
    eyes = gaze(target)
    track = stage.lock(target, EyeAngles(eyes.pan_left_rad, eyes.pan_left_rad, eyes.tilt_rad))
    assert track.disparity_px == pytest.approx(539 * 0.065 / 0.35, rel=0.02)
    assert track.right_px[0] == pytest.approx(track.left_px[0] - track.disparity_px)


def test_the_disparity_of_a_slanted_thing_is_that_of_the_point_that_was_looked_at(stage):
    slant_rad, aside_m = math.radians(35.0), 0.012
    step = aside_m * np.array([math.sin(slant_rad), -math.cos(slant_rad), 0.0])
    center = np.array([0.35, 0.0, 0.0])
    eyes = gaze(center + step)
    for _ in range(20):
        track = stage.show(center, eyes, slant_rad=slant_rad)
    assert track.status is TrackStatus.OK, track.reason
    # Its middle, where the track says that it is, has two pixels more of it.
    truth = pixel(center, True, eyes) - pixel(center, False, eyes)
    assert truth[0] > 1.9
    assert abs(track.left_px[0] - pixel(center, True, eyes)[0]) < 3.0
    assert track.disparity_px == pytest.approx(0.0, abs=0.4)


def test_a_target_is_followed_to_the_border_beyond_which_the_point_looked_at_lies(stage):
    center, beside = np.array([0.35, 0.0, 0.0]), np.array([0.0, -0.02, 0.0])
    eyes = gaze(center + beside)
    stage.lock(center, eyes)
    beyond = 0
    for step in range(60):
        turned = EyeAngles(eyes.pan_left_rad + 0.012 * step, eyes.pan_right_rad + 0.012 * step, eyes.tilt_rad)
        track = stage.show(center, turned)
        beyond += track.status is TrackStatus.OK and pixel(center + beside, True, turned)[0] > 640.0
    assert beyond


@pytest.mark.parametrize("servo_step_deg", [0.0, 1.0])
def test_it_follows_20_degrees_a_second(stage, servo_step_deg):
    def target(moved_deg):
        return (0.8 * math.cos(math.radians(moved_deg)), 0.8 * math.sin(math.radians(moved_deg)), 0.0)

    first = stage.lock(target(0.0), gaze(target(0.0)))
    start = len(stage.errors)
    for k in range(24):
        seen = target(20 * FRAME_S * (k + 1))
        eyes = gaze(target(servo_step_deg * (20 * FRAME_S * k // servo_step_deg) if servo_step_deg else 0.0))
        track = stage.show(seen, eyes)
        assert track.status is TrackStatus.OK, track.reason
        assert track.track_id == first.track_id
    assert np.abs(stage.errors[start:]).max() < 4.0


def test_it_follows_in_depth(stage):
    stage.lock((0.5, 0.0, 0.0), gaze((0.5, 0.0, 0.0)))
    width_px = stage.tracks[-1].extent_px[0]
    for k in range(30):
        track = stage.show((0.5 + 0.012 * k, 0.0, 0.0), gaze((0.5, 0.0, 0.0)))
        assert track.status is TrackStatus.OK, track.reason
    assert abs(stage.errors[-1][2]) < 1.0
    assert track.extent_px[0] == pytest.approx(width_px * 0.5 / 0.85, rel=0.15)


def test_a_blink_of_a_second_is_survived_and_reported(stage):
    target = (0.8, 0.0, 0.0)
    first = stage.lock(target, gaze(target))
    for _ in range(30):
        track = stage.show(target, gaze(target), covered=("left", "right"))
        assert track.status is TrackStatus.LOST
        assert math.isnan(track.left_px[0])
        assert math.isnan(track.disparity_px)
        assert track.confidence == 0.0
    track = stage.show(target, gaze(target))
    assert track.status is TrackStatus.OK
    assert track.track_id == first.track_id
    assert np.abs(stage.errors[-1]).max() < 2.0


@pytest.mark.parametrize("moves_m", [0.0, 0.004])
def test_joints_that_were_wrong_once_do_not_send_it_away(stage, moves_m):
    """Servos without feedback are off their reported angles while they move, and their images blur."""
    place = np.array([0.8, 0.0, 0.0])
    first = stage.lock(place, eyes := gaze(place))
    step = np.array([0.0, moves_m, 0.0])
    for _ in range(8):
        stage.show(place := place + step, eyes)
    wrong = EyeAngles(eyes.pan_left_rad + 0.04, eyes.pan_right_rad + 0.04, 0.0)
    stage.show(place := place + step, eyes, joints=wrong)
    for _ in range(12):
        stage.show(place := place + step, eyes, covered=("left", "right"))
    for _ in range(3):
        track = stage.show(place := place + step, eyes)
    assert (track.status, track.track_id) == (TrackStatus.OK, first.track_id)
    assert np.abs(stage.errors[-1]).max() < 3.0


def test_a_covered_right_eye_leaves_the_direction(stage):
    target = (0.8, 0.0, 0.0)
    stage.lock(target, gaze(target))
    track = stage.show(target, gaze(target), covered=("right",))
    assert track.status is TrackStatus.OCCLUDED
    assert np.abs(stage.errors[-1][:2]).max() < 2.0
    assert math.isnan(track.disparity_px)
    assert math.isnan(track.right_px[0])
    assert track.reason


def test_it_does_not_leave_with_something_that_crosses(stage):
    target = (0.9, 0.0, 0.0)
    first = stage.lock(target, gaze(target))
    for k in range(45):
        track = stage.show(target, gaze(target), occluder_m=(0.55, 0.22 - 0.01 * k, 0.0))
        if track.status in (TrackStatus.OK, TrackStatus.OCCLUDED):
            assert np.abs(stage.errors[-1][:2]).max() < 6.0
        assert track.track_id == first.track_id
    assert any(t.status is TrackStatus.LOST for t in stage.tracks[12:])
    assert track.status is TrackStatus.OK
    assert abs(stage.errors[-1][2]) < 0.5


def test_a_saccade_to_another_thing_locks_anew(stage):
    target, other = (0.7, 0.15, 0.0), (0.7, -0.05, 0.0)
    first = stage.lock(target, gaze(target))
    start, goal = gaze(target), gaze(other)
    for k in range(12):
        share = min((k + 1) / 3, 1.0)
        eyes = EyeAngles(
            start.pan_left_rad + share * (goal.pan_left_rad - start.pan_left_rad),
            start.pan_right_rad + share * (goal.pan_right_rad - start.pan_right_rad),
            0.0,
        )
        track = stage.show(target, eyes, occluder_m=other)
    statuses = [t.status for t in stage.tracks[-12:]]
    assert TrackStatus.LOCKING in statuses
    assert track.status is TrackStatus.OK
    assert track.track_id == first.track_id + 1
    assert np.abs(np.array(track.left_px) - pixel(other, True, goal)).max() < 3.0


@pytest.mark.parametrize("hidden", [False, True])
def test_a_small_saccade_to_another_thing_locks_anew(stage, hidden):
    """A goal three degrees beside the old one: what was followed before is seen on, or hidden."""
    target, other = (1.6, 0.04, 0.0), (1.0, -0.03, 0.0)
    first = stage.lock(target, gaze(target))
    for _ in range(12):
        track = stage.show((5.0, -3.0, 0.0) if hidden else target, gaze(other), occluder_m=other)
    assert (track.status, track.track_id) == (TrackStatus.OK, first.track_id + 1)
    assert np.abs(np.array(track.left_px) - pixel(other, True, gaze(other))).max() < 3.0


def test_a_saccade_towards_the_target_keeps_it(stage):
    target = (0.7, 0.12, 0.0)
    first = stage.lock((0.7, 0.0, 0.0), gaze((0.7, 0.0, 0.0)))
    for k in range(12):
        stage.show((0.7, 0.01 * (k + 1), 0.0), gaze((0.7, 0.0, 0.0)))
    start, goal = gaze((0.7, 0.0, 0.0)), gaze(target)
    for k in range(10):
        share = min((k + 1) / 2, 1.0)
        eyes = EyeAngles(
            start.pan_left_rad + share * (goal.pan_left_rad - start.pan_left_rad),
            start.pan_right_rad + share * (goal.pan_right_rad - start.pan_right_rad),
            0.0,
        )
        track = stage.show(target, eyes)
    assert track.status is TrackStatus.OK
    assert track.track_id == first.track_id
    assert np.abs(stage.errors[-1]).max() < 3.0


def test_a_target_that_stays_away_is_given_up_until_the_next_saccade():
    stage = Stage()
    stage.tracker = TargetTracker(
        TrackerParameters(give_up_s=0.3), make_estimator(DisparityParameters()), CAMERA, Kinematics(RIG)
    )
    target = (0.8, 0.0, 0.0)
    stage.lock(target, gaze(target))
    for _ in range(14):
        stage.show(target, gaze(target), covered=("left", "right"))
    for _ in range(5):
        assert stage.show(target, gaze(target)).status is TrackStatus.LOST
    stage.tracker.lock_here()
    assert stage.lock(target, gaze(target)).track_id == 2


def test_time_that_jumps_back_starts_afresh(stage):
    target = (0.8, 0.0, 0.0)
    first = stage.lock(target, gaze(target))
    stage.frame = 0
    assert stage.show(target, gaze(target)).status is TrackStatus.LOCKING
    assert stage.lock(target, gaze(target)).track_id == first.track_id + 1


def test_a_blank_fovea_is_not_locked_on():
    tracker = Stage().tracker
    blank = np.full((480, 640), 120, np.uint8)
    tracks = [tracker.update(blank, blank, k * FRAME_S, EyeAngles(0.0, 0.0, 0.0)) for k in range(10)]
    track = tracks[-1]
    assert track.status is TrackStatus.UNLOCKED
    assert track.track_id == 0
