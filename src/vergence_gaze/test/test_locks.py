"""Which track and which boxes are the target's, and how far beside them it lies."""

import math

import numpy as np
import pytest

from vergence_gaze.estimation.locks import BoxLock, TrackLock
from vergence_gaze.estimation.observations import TrackSighting
from vergence_gaze.estimation.target_filter import TargetEstimate
from vergence_gaze.estimation.tracking import TargetTracking
from vergence_gaze.joints.joint_moves import JointMoves
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_rig.rig import default_rig

DEG = math.pi / 180.0
PLACE = np.array([1.0, 7.0, 2.0]) * DEG  # left pan, right pan, tilt
ESTIMATE = TargetEstimate(np.array([4.0, 6.0, 2.0]) * DEG, np.zeros(3), np.eye(3) * 1e-6, False)


def moved(pan_deg: float, tilt_deg: float) -> np.ndarray:
    return PLACE + np.array([pan_deg, pan_deg, tilt_deg]) * DEG


def adopted(seen_rad: np.ndarray) -> TrackLock:
    lock = TrackLock()
    assert lock.adopt(1, seen_rad, ESTIMATE, 0.07, 0.02) == ""
    return lock


def test_the_first_track_keeps_the_click() -> None:
    np.testing.assert_allclose(adopted(moved(0.5, -0.3)).offset, np.array([-0.5, 0.3]) * DEG, atol=1e-12)


def test_an_offset_is_learnt_from_boxes_of_the_same_pair_alone() -> None:
    lock = adopted(PLACE)
    lock.add(1.0, 1, moved(0.8, 0.0))
    lock.correct_offset(1.1, PLACE)
    np.testing.assert_allclose(lock.offset, 0.0, atol=1e-12)
    for k in range(12):
        lock.add(2.0 + 0.1 * k, 1, moved(0.8, -0.2))
        lock.correct_offset(2.0 + 0.1 * k, PLACE)
    np.testing.assert_allclose(lock.offset, np.array([-0.8, 0.2]) * DEG, atol=0.02 * DEG)


def test_the_first_box_sets_the_offset_of_a_new_track() -> None:
    lock = adopted(PLACE)
    assert lock.adopt(2, moved(0.5, 0.0), ESTIMATE, 0.07, 0.02) == ""
    np.testing.assert_allclose(lock.offset, 0.0)
    lock.add(1.0, 2, moved(0.5, 0.0))
    lock.correct_offset(1.0, PLACE)
    np.testing.assert_allclose(lock.offset, np.array([-0.5, 0.0]) * DEG, atol=1e-12)


def test_a_rejected_track_gives_no_place_any_more() -> None:
    lock = adopted(PLACE)
    lock.add(1.0, 1, PLACE)
    assert lock.place_at(1.0) is not None
    lock.reject()
    assert lock.place_at(1.0) is None
    assert "not the target" in lock.adopt(1, PLACE, ESTIMATE, 0.07, 0.02)


def test_boxes_that_one_eye_alone_saw_correct_nothing() -> None:
    lock = adopted(PLACE)
    lock.add(1.0, 1, moved(0.5, 0.0))
    lock.correct_offset(1.0, np.array([math.nan, *PLACE[1:]]))
    np.testing.assert_allclose(lock.offset, 0.0, atol=1e-12)


def followed(lock: TrackLock) -> int | None:
    return lock.track_id


def test_a_class_takes_the_track_that_its_boxes_are_around_in_one_pair() -> None:
    lock = TrackLock()
    lock.add(1.0, 7, moved(0.3, -0.2))
    lock.adopt_by_class(1.1, ESTIMATE, PLACE, 0.1, 0.01)
    assert followed(lock) is None, "another pair"
    lock.adopt_by_class(1.0, ESTIMATE, PLACE, 0.1, 0.01)
    assert followed(lock) == 7
    place = lock.place_at(1.0)
    assert place is not None
    np.testing.assert_allclose(place, PLACE[[0, 2]], atol=1e-12)


@pytest.mark.parametrize(
    "seen_rad",
    [moved(4.0, 0.0), moved(0.0, 4.0), PLACE + np.array([0.0, 1.0, 0.0]) * DEG],
    ids=["beside", "below", "deeper"],
)
def test_a_class_leaves_a_track_of_another_thing_and_releases_one_that_strays(seen_rad: np.ndarray) -> None:
    lock = TrackLock()
    lock.add(1.0, 7, seen_rad)
    lock.adopt_by_class(1.0, ESTIMATE, PLACE, 0.1, 0.01)
    assert followed(lock) is None
    lock.add(2.0, 7, PLACE)
    lock.adopt_by_class(2.0, ESTIMATE, PLACE, 0.1, 0.01)
    assert followed(lock) == 7
    for stamp_s, seen, kept in (
        (3.0, seen_rad, True),
        (4.0, PLACE, True),
        (5.0, seen_rad, True),
        (6.0, seen_rad, False),
    ):
        lock.add(stamp_s, 7, seen)
        assert lock.correct_offset_by_class(stamp_s, PLACE, 0.1, 0.01) is kept
    lock.reject()
    lock.add(7.0, 7, PLACE)
    lock.adopt_by_class(7.0, ESTIMATE, PLACE, 0.1, 0.01)
    assert followed(lock) is None


@pytest.mark.parametrize(("left_rad", "extent_rad"), [(math.nan, 0.1), (PLACE[0], math.nan)])
def test_boxes_without_place_or_width_neither_give_nor_take_a_track(left_rad: float, extent_rad: float) -> None:
    lock, vague = TrackLock(), np.array([left_rad, *PLACE[1:]])
    lock.add(1.0, 7, moved(9.0, 0.0))
    lock.adopt_by_class(1.0, ESTIMATE, vague, extent_rad, 0.01)
    assert followed(lock) is None
    lock.add(2.0, 7, PLACE)
    lock.adopt_by_class(2.0, ESTIMATE, PLACE, 0.1, 0.01)
    for stamp_s in (3.0, 4.0, 5.0):
        lock.add(stamp_s, 7, moved(9.0, 0.0))
        assert lock.correct_offset_by_class(stamp_s, vague, extent_rad, 0.01)


def test_a_track_seen_by_one_eye_is_taken_by_its_direction() -> None:
    lock = TrackLock()
    lock.add(1.0, 7, np.array([PLACE[0], math.nan, PLACE[2]]))
    lock.adopt_by_class(1.0, ESTIMATE, PLACE, 0.1, 0.01)
    assert followed(lock) == 7


def test_boxes_learn_from_the_track_at_first_and_then_stand() -> None:
    lock = BoxLock()
    for _ in range(5):
        assert lock.adopt(moved(0.4, 0.1), 0.1, math.inf, ESTIMATE)
        lock.correct_offset(moved(0.4, 0.1), PLACE[[0, 2]])
    np.testing.assert_allclose(lock.offset, np.array([-0.4, -0.1]) * DEG, atol=1e-12)
    for _ in range(10):
        assert lock.adopt(moved(1.4, 0.1), 0.1, math.inf, ESTIMATE)
        lock.correct_offset(moved(1.4, 0.1), PLACE[[0, 2]])
    assert abs(lock.offset[0] + 0.4 * DEG) < 0.11 * DEG


def test_boxes_do_not_learn_from_boxes_alone() -> None:
    lock = BoxLock()
    for k in range(5):
        assert lock.adopt(moved(0.4 * k, 0.0), 0.1, math.inf, ESTIMATE)
        lock.correct_offset(moved(0.4 * k, 0.0), None)
    np.testing.assert_allclose(lock.offset, 0.0, atol=1e-12)


@pytest.mark.parametrize(("depth", "aside_deg", "taken"), [(True, 3.0, True), (False, 3.0, False), (False, 1.0, True)])
def test_a_track_of_unknown_depth_is_the_target_only_near_it(depth: bool, aside_deg: float, taken: bool) -> None:
    rig, parameters = default_rig(), gaze_parameters()
    history = ShaftHistory(rig)
    for stamp_s in (0.9, 1.0, 1.1):
        history.add(stamp_s, {"pan_left": PLACE[0], "pan_right": PLACE[1], "tilt": 0.0})
    tracking = TargetTracking(rig, parameters, history, JointMoves(rig, history))
    tracking.request_target(1.0, 1.0, np.array([4.0, 6.0, 0.0]) * DEG, np.eye(3) * 1e-6)
    x, disparity = -math.tan(aside_deg * DEG), 0.0 if depth else math.nan
    sighting = TrackSighting(1.05, 0.0, 1, 1.0, x, 0.0, disparity, 0.001, 0.1, True)
    assert tracking.update_track(sighting, 1.1) is taken
    assert taken or "deg away" in tracking.note
