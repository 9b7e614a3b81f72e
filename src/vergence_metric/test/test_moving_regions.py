"""What moves although the eyes turn: flow, its mask, its points in space, and a goal that waits for it."""

import math

import cv2
import numpy as np
import pytest

from vergence_metric.testing.rendered_boards import CAMERA, FRAME_S, RIG, TARGET, Stage, gaze, texture, true_pixel
from vergence_metric.tracking.eye_view import EyeView
from vergence_metric.tracking.motion.awaited_motion import AwaitedMotion
from vergence_metric.tracking.motion.correlation_pyramid import match_region
from vergence_metric.tracking.motion.eye_motion import compensated
from vergence_metric.tracking.motion.horn_schunck import horn_schunck
from vergence_metric.tracking.motion.moving_region import MotionDetector, MovingRegion
from vergence_metric.tracking.motion.occlusion_mesh import occluded
from vergence_metric.tracking.motion.region_points import region_points
from vergence_metric.tracking.request import TrackRequest
from vergence_metric.tracking.track import TrackStatus
from vergence_rig.geometry import EyeAngles
from vergence_rig.kinematics import Kinematics

PLACE, STEP = np.array([0.6, 0.0, 0.0]), np.array([0.0, 0.007, 0.0])  # 20 degrees a second


@pytest.fixture
def stage():
    cv2.setRNGSeed(1)
    return Stage("moving_target")


@pytest.mark.parametrize("shift", [(0.4, -0.2), (3.0, 1.0), (-9.0, 4.0)])
def test_flow_is_the_shift_of_a_texture(shift):
    wide = texture(11, (300, 400), (1.5, 4.0, 9.0))
    y, x = np.mgrid[0:240, 0:320].astype(np.float32)
    before = cv2.remap(wide, x + 40, y + 30, cv2.INTER_CUBIC).astype(np.uint8)
    after = cv2.remap(wide, x + 40 - shift[0], y + 30 - shift[1], cv2.INTER_CUBIC).astype(np.uint8)
    inner = horn_schunck(before, after)[40:-40, 40:-40]
    np.testing.assert_allclose(np.median(inner, axis=(0, 1)), shift, atol=0.15)


def test_a_mesh_that_folds_is_occlusion_and_one_that_moves_as_a_whole_is_not():
    image = texture(12, (240, 320), (2.0, 4.0)).astype(np.uint8)
    flow = np.zeros((240, 320, 2), np.float32)
    flow[..., 0] = 5.0
    assert not occluded(image, flow).any()
    flow[:, 160:, 0] = -40.0
    hidden = occluded(image, flow)
    assert hidden[20:-20, 150:170].mean() > 0.5
    assert hidden[20:-20, :100].mean() < 0.05


@pytest.mark.parametrize("wrong_deg", [0.0, 0.4])
def test_the_turn_of_an_eye_is_taken_out_of_the_image_though_its_joints_are_wrong(stage, wrong_deg):
    far = (30.0, 0.0, 0.0)
    first, second = EyeAngles(0.0, 0.0, 0.0), EyeAngles(0.03, 0.03, -0.02)
    stage.show(far, first)
    before, before_view = stage.pair.left, stage.pair.views[0]
    reported = EyeAngles(0.03 + math.radians(wrong_deg), 0.03, -0.02)
    stage.show(far, second, joints=reported)
    turned, reached = compensated(before, stage.pair.left, (before_view, stage.pair.views[0]), 1.0)
    off = np.abs(turned.astype(float) - stage.pair.left)[reached]
    assert reached.mean() > 0.9
    # The noise of both images, little more.
    assert np.median(off) < 3.0


def moving(stage, pairs, eyes_of):
    """Show a board that moves; returns what was detected in each pair."""
    detector, found = MotionDetector(), []
    for k in range(pairs):
        place = PLACE + k * STEP
        stage.show(place, eyes_of(place))
        found.append((place, detector.update(stage.pair.left, stage.pair.views[0], stage.pair.stamp_s)))
    return found


@pytest.mark.parametrize("follow", [False, True])
def test_a_moving_board_is_masked_with_still_eyes_and_while_they_turn(stage, follow):
    for place, region in moving(stage, 8, lambda place: gaze(place if follow else PLACE))[3:]:
        assert isinstance(region, MovingRegion), region
        eyes = gaze(place if follow else PLACE)
        true = np.zeros((480, 640), np.uint8)
        corners = [
            place + np.array([0.0, i, j]) for i, j in ((-0.03, -0.03), (0.03, -0.03), (0.03, 0.03), (-0.03, 0.03))
        ]
        cv2.fillConvexPoly(true, np.rint([true_pixel(c, True, eyes) for c in corners]).astype(np.int32), 1)
        mask = cv2.resize(region.mask.astype(np.uint8), (640, 480), interpolation=cv2.INTER_NEAREST)
        assert (mask & true).sum() / (mask | true).sum() > 0.6


def test_a_bare_wall_that_a_thin_thing_has_uncovered_does_not_belong_to_it():
    bar, detector, view = texture(14, (120, 12), (1.5, 3.0)), MotionDetector(), EyeView(CAMERA, 0.0, 0.0)
    room, rng = texture(15, (240, 320), (2.0, 5.0)), np.random.default_rng(3)
    room[50:190] = 110.0
    for k in range(6):
        image, left = room.copy(), 200 - 7 * k
        image[60:180, left : left + 12] = bar
        noisy = np.clip(image + rng.normal(0.0, 1.5, image.shape), 0, 255).astype(np.uint8)
        region = detector.update(noisy, view, k * FRAME_S)
    assert isinstance(region, MovingRegion), region
    true = np.zeros((240, 320), bool)
    true[60:180, left : left + 12] = True
    assert (region.mask & true).sum() / (region.mask | true).sum() > 0.7


def test_nothing_moves_where_only_the_eyes_do(stage):
    detector = MotionDetector()
    for k in range(8):
        stage.show((30.0, 0.0, 0.0), EyeAngles(0.01 * k, 0.01 * k, 0.0))
        found = detector.update(stage.pair.left, stage.pair.views[0], stage.pair.stamp_s)
        assert isinstance(found, str), found
        assert found


def test_correlation_pyramids_match_a_shifted_texture_and_nothing_in_a_blank_one():
    wide = texture(13, (160, 260), (1.5, 3.0)).astype(np.uint8)
    left, right = wide[:, 40:240], wide[:, 57:257]
    mask = np.zeros(left.shape, bool)
    mask[50:110, 60:140] = True
    found = match_region(left, right, mask, (0, 40), 2)
    assert len(found.points_px) > 0.8 * mask.sum() / 16
    assert np.median(np.abs(found.across_px - 17.0)) < 0.2
    assert (np.abs(found.across_px - 17.0) < 1.0).mean() > 0.95
    blank = np.full_like(left, 99)
    assert len(match_region(blank, blank, mask, (0, 40), 2).points_px) == 0


def test_its_points_lie_where_the_board_is(stage):
    found = moving(stage, 6, lambda place: gaze(PLACE))
    place, region = found[-1]
    points = region_points(region, stage.pair, Kinematics(RIG))
    assert not isinstance(points, str), points
    assert np.linalg.norm(points.center_m) == pytest.approx(np.linalg.norm(place), rel=0.02)
    assert (points.spread_m < 0.04).all()
    assert points.disparity_px == pytest.approx(
        float((true_pixel(place, True, gaze(PLACE)) - true_pixel(place, False, gaze(PLACE)))[0]), abs=1.0
    )


def test_a_requested_target_that_stops_is_lost_and_the_reason_says_so(stage):
    stage.show(PLACE, gaze(PLACE))
    stage.tracker.request(
        TrackRequest(4, stage.pair.stamp_s, True, tuple(true_pixel(PLACE, True, gaze(PLACE)))), stage.pair
    )
    for k in range(1, 9):
        track = stage.show(PLACE + k * STEP, gaze(PLACE))
    assert (track.status, track.goal_id) == (TrackStatus.OK, 4), track.reason
    assert np.abs(stage.errors[-1][:2]).max() < 15.0
    for _ in range(3):
        track = stage.show(PLACE + 8 * STEP, gaze(PLACE))
    assert (track.status, track.goal_id) == (TrackStatus.LOST, 4)
    assert "nothing moves" in track.reason


def test_what_moves_at_another_depth_is_something_else(stage):
    stage.show(PLACE, gaze(PLACE))
    stage.tracker.request(
        TrackRequest(4, stage.pair.stamp_s, True, tuple(true_pixel(PLACE, True, gaze(PLACE)))), stage.pair
    )
    for k in range(1, 12):
        track = stage.show(PLACE, gaze(PLACE), occluder_m=(0.4, 0.06 - 0.007 * k, 0.0))
        assert track.status is not TrackStatus.OK


def test_a_goal_waits_for_motion_and_then_asks_for_what_moves(stage):
    awaited = AwaitedMotion(9)
    answers = []
    for k in range(12):
        stage.show(PLACE + max(k - 4, 0) * STEP, gaze(PLACE))
        answers.append(awaited.update(stage.pair))
    assert all(isinstance(answer, str) for answer in answers[:5])
    asked = next(answer for answer in answers if isinstance(answer, TrackRequest))
    assert (asked.goal_id, asked.left_eye, asked.motion) == (9, True, False)
    when = answers.index(asked)
    true = true_pixel(PLACE + (when - 4) * STEP, True, gaze(PLACE))
    assert np.hypot(*(np.array(asked.pixel) - true)) < 20.0
    assert asked.extent_px is not None
    assert asked.stamp_s == pytest.approx(when * FRAME_S)


def test_images_that_do_not_follow_one_another_show_no_motion():
    detector, image = MotionDetector(), TARGET.astype(np.uint8)
    view = EyeView(CAMERA, 0.0, 0.0)
    assert isinstance(detector.update(image, view, 1.0), str)
    assert isinstance(detector.update(image[:50], view, 1.03), str)
    assert isinstance(detector.update(image[:50], view, 9.0), str)
