"""The benchmark `trackers`: truth lies where the pixels are, scores say what they claim; and the goal MOTION."""

import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import cv2
import numpy as np
import pytest

from bench.photos_lockstep import Lockstep, clock_s
from bench.trackers_boxes import run_given_boxes
from bench.trackers_pasted import moving_pieces
from bench.trackers_photographs import NoPhotographsError, photograph_rig
from bench.trackers_runs import Run
from bench.trackers_scenes import FRAME_S, REQUEST_FRAME, SCENES, THINGS, Frame, Scene, sequence
from bench.trackers_scores import score, step_px
from vergence_gaze.goals.goal import Goal, GoalKind, Result, TrackRequest
from vergence_gaze.ros import gaze_messages
from vergence_metric.ros import track_messages
from vergence_rig.camera import CameraModel
from vergence_rig.eye_image import eye_images
from vergence_rig.rig import default_rig
from vergence_sim.parameters import SimParameters
from vergence_sim.renderer import RenderError
from vergence_sim.simulator import Simulator

CAMERA = CameraModel(photograph_rig().left_camera)
BY_NAME = {scene.name: scene for scene in SCENES}


def frames_of(scene: Scene, thing: str) -> list[Frame]:
    try:
        return list(sequence(scene, thing))
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")


@pytest.mark.parametrize("thing", THINGS)
def test_the_truth_is_where_the_target_is_seen_and_turns_with_it(thing: str) -> None:
    turning = BY_NAME["turning"]
    still = frames_of(replace(turning, pairs=1), thing)[0]
    turned = frames_of(Scene("late", 1, lambda _: turning.pose(1.3)), thing)[0]
    for frame in (still, turned):
        x, y = frame.left_px
        low, high = frame.outline_px.min(axis=0), frame.outline_px.max(axis=0)
        assert low[0] < x < high[0]
        assert low[1] < y < high[1]
        assert frame.visible
        assert not frame.hidden
    # The eyes fixate the point itself.
    assert still.left_px == pytest.approx((319.5, 239.5), abs=0.01)
    assert still.left_px[0] - still.right_px[0] == pytest.approx(0.0, abs=0.01)
    assert np.linalg.norm(turned.point_m - still.point_m) < 0.06


def test_what_covers_the_target_covers_it_in_the_truth_too() -> None:
    covered = Scene("covered", 1, lambda _: BY_NAME["twin"].pose(1.15))
    assert frames_of(covered, "cube")[0].hidden
    half = Scene("half", 1, lambda _: BY_NAME["half_hidden"].pose(2.0))
    frame = frames_of(half, "cube")[0]
    assert not frame.hidden
    assert frame.visible


@pytest.fixture(scope="module")
def piece() -> list[Frame]:
    try:
        return next(moving_pieces(follow=True))[1]
    except NoPhotographsError as error:
        pytest.skip(str(error))


def test_a_piece_of_a_photograph_moves_as_its_truth_says_and_keeps_its_disparity(piece: list[Frame]) -> None:
    moving = piece[15:]
    to_the_right = [CAMERA.angles([frame.left_px])[0][0] - frame.true_eyes.pan_left_rad for frame in moving]
    assert np.diff(to_the_right) / FRAME_S == pytest.approx(-math.radians(20.0), rel=0.01)
    for frame in moving:
        assert frame.left_px[0] - frame.right_px[0] == pytest.approx(0.0, abs=0.5), "both eyes are late alike"
    # What is seen at the place, less where the noise is, is the same in all images.
    seen = [cv2.getRectSubPix(frame.left, (31, 31), frame.left_px).astype(float) for frame in moving]
    assert all(np.corrcoef(seen[0].ravel(), one.ravel())[0, 1] > 0.9 for one in seen)


def test_matching_inside_given_boxes_is_better_than_their_centres(piece: list[Frame]) -> None:
    given = run_given_boxes(piece[:12], photograph_rig())
    assert given.detected == 0.0, "no cube is in the photographs"
    off = given.run.disparity_px - [frame.left_px[0] - frame.right_px[0] for frame in piece[REQUEST_FRAME:12]]
    assert np.isfinite(given.run.left_px).all()
    assert float(np.nanstd(off)) < given.centers_px


@pytest.fixture(scope="module")
def rest() -> list[Frame]:
    return frames_of(replace(BY_NAME["rest"], pairs=20), "cube")


def test_scores_are_what_they_say(rest: list[Frame]) -> None:
    truth = np.array([frame.left_px for frame in rest[REQUEST_FRAME:]])
    count = len(truth)
    nothing = np.full(count, math.nan)
    aside = Run(truth + np.array([3.0, 0.0]), nothing, 1.0)
    good = score(rest, aside)
    assert (good.rms_px, good.drift_px, good.lost, good.false_locks) == (0.0, 0.0, 0.0, 0.0), "another point of it"
    wandering = truth.copy()
    wandering[:, 0] += np.linspace(0.0, 8.0, count)
    assert 4.0 < score(rest, Run(wandering, nothing, 1.0)).drift_px < 8.0
    gone = truth.copy()
    gone[5:10] = math.nan
    gone[12:] += 200.0
    bad = score(rest, Run(gone, nothing, 1.0))
    assert bad.lost == pytest.approx(5 / count)
    assert bad.false_locks == 1.0
    assert bad.rms_px > 50.0
    assert math.isnan(score(rest, Run(np.full((count, 2), math.nan), nothing, 1.0)).rms_px)
    stepped = truth.copy()
    stepped[8:] += (0.0, 2.0)
    assert step_px(rest, Run(stepped, nothing, 1.0), range(4, 9), range(13, 19)) == pytest.approx(2.0)


def test_a_target_that_was_hidden_is_found_again_or_never(rest: list[Frame]) -> None:
    shown = [replace(f, hidden=8 <= k < 12, visible=not 8 <= k < 12) for k, f in enumerate(rest)]
    places = np.array([frame.left_px for frame in shown[REQUEST_FRAME:]])
    places[5:12] = math.nan
    nothing = np.full(len(places), math.nan)
    assert score(shown, Run(places, nothing, 1.0)).reacquired_s == pytest.approx(3 / 30)
    places[5:] = math.nan
    assert math.isinf(score(shown, Run(places, nothing, 1.0)).reacquired_s)


def test_a_request_for_motion_reaches_the_tracker_as_one() -> None:
    rig = default_rig()
    images = eye_images(rig, (CameraModel(rig.left_camera), CameraModel(rig.right_camera)))
    message = gaze_messages.track_request(TrackRequest(7, motion=True), images)
    got = track_messages.track_request(message, images)
    assert (got.goal_id, got.motion) == (7, True)
    assert not track_messages.track_request(gaze_messages.track_request(TrackRequest(0), images), images).motion


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    try:
        made = Simulator(SimParameters.of({"head.model": "ideal", "servo": "ideal", "target.y_m": 0.1}))
    except RenderError as error:
        pytest.skip(f"no OpenGL here: {error}")
    with closing(made):
        yield made


def test_a_goal_of_motion_waits_with_still_eyes_and_then_verges_on_what_moves(simulator: Simulator) -> None:
    lockstep, outcomes = Lockstep(simulator, simulator.rig), []
    lockstep.on_step = lambda command: outcomes.extend(command.outcomes)
    lockstep.advance_to(0.5)
    lockstep.controller.look_at(Goal(GoalKind.MOTION, time_limit_s=20.0), clock_s(simulator.time_s))
    lockstep.advance_to(1.3)
    assert outcomes == []
    assert max(abs(angle) for angle in simulator.true_joints().values()) < 0.02
    moving = {"motion.kind": "sinusoid", "motion.y_m": -0.12, "motion.frequency_hz": 0.15}
    simulator.set_parameters(simulator.parameters.replaced(moving))
    while simulator.time_s < 6.0 and not outcomes:
        lockstep.advance_to(simulator.time_s + 0.1)
    assert [outcome.result for outcome in outcomes] == [Result.VERGED], outcomes
    # On the cube, which is 4 degrees wide, not on the room.
    assert math.degrees(simulator.truth().left_error_rad) < 2.0
