"""Each gate by itself: what it accepts, what it refuses, and the reason that it gives."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vergence_gaze.estimation.gates import (
    ClassGate,
    Gate,
    JumpGate,
    MeasuredGate,
    NewerGate,
    PointGate,
    RequestGate,
    Sighting,
    StillGate,
    Verdict,
)
from vergence_gaze.estimation.kalman import Measurement
from vergence_gaze.estimation.observations import BoxSighting, PointSighting, TrackSighting
from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.estimation.tracking import TargetTracking
from vergence_gaze.goals.requested_point import RequestedPoint
from vergence_gaze.joints.joint_moves import JointMoves
from vergence_gaze.joints.shaft_history import ShaftHistory
from vergence_gaze.parameter_groups import gaze_parameters
from vergence_gaze.target_parameters import TargetParameters
from vergence_rig.kinematics import Kinematics
from vergence_rig.rig import default_rig

P = TargetParameters()
HERE, NEAR, FAR = 0.08, 0.13, 0.04
NOTHING = Measurement(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0))
TRACK = TrackSighting(1.0, 0.0, 1, 0.0, 0.0, 0.0, 0.0, 0.001, 0.1, True, goal_id=3)
BOX = BoxSighting(1.0, 0.0, 0.0, 0.0, 0.0, 0.0, math.nan, 0.002, 0.1, "cube", True)


def joints(version_rad: float, vergence_rad: float, tilt_rad: float = 0.0) -> np.ndarray:
    return np.array([version_rad - 0.5 * vergence_rad, version_rad + 0.5 * vergence_rad, tilt_rad])


def estimate(vergence_rad: float = HERE, moving: bool = False) -> TargetEstimate:
    rates = np.array([0.2, 0.0, 0.0]) if moving else np.zeros(3)
    return TargetEstimate(np.array([0.0, vergence_rad, 0.0]), rates, np.eye(3) * 1e-7, moving)


def sighting(seen_rad: np.ndarray, stamp_s: float = 1.0, source: str = "box", extent_rad: float = 0.1) -> Sighting:
    observation = replace(TRACK if source == "track" else BOX, stamp_s=stamp_s)
    return Sighting(source, observation, lambda: (NOTHING, seen_rad), 0.0, extent_rad)


def first_accepted_s(gate: Gate, seen_rad: np.ndarray, target: TargetEstimate, source: str = "box") -> float:
    """Return after how long what is seen at one place at 30 Hz is accepted."""
    for i in range(60):
        if gate.check(sighting(seen_rad, 10.0 + i / 30.0, source), target).accepted:
            return i / 30.0
    return math.inf


def test_what_its_estimator_does_not_call_measured_is_refused_with_its_reason() -> None:
    gate = MeasuredGate()
    assert gate.check(sighting(joints(0, HERE)), None).accepted
    blind = Sighting("track", replace(TRACK, usable=False, reason="hidden for 0.4 s"), lambda: (NOTHING, np.zeros(3)))
    assert gate.check(blind, None) == Verdict(False, "hidden for 0.4 s")
    silent = Sighting("box", replace(BOX, usable=False), lambda: (NOTHING, np.zeros(3)))
    assert gate.check(silent, None) == Verdict(False, "the box shows no target")
    assert gate.check(Sighting("point", PointSighting(1.0, (1.0, 0.0, 0.0), 0.1), lambda: (NOTHING, np.zeros(3))), None)


@pytest.mark.parametrize(
    ("asked", "track", "box", "point"),
    [
        (RequestGate(), False, False, False),
        (RequestGate(3), True, False, False),
        (RequestGate(4), False, False, False),
        (RequestGate(3, "cube"), True, True, False),
        (RequestGate(3, "cup"), True, False, False),
        (RequestGate(3, ""), True, True, False),
        (RequestGate(stream=True), False, False, True),
    ],
)
def test_only_what_was_asked_for_passes(asked: RequestGate, track: bool, box: bool, point: bool) -> None:
    there = joints(0.0, HERE)
    streamed = Sighting("point", PointSighting(1.0, (1.0, 0.0, 0.0), 0.1), lambda: (NOTHING, there))
    seen = (sighting(there, source="track"), sighting(there), streamed)
    assert tuple(asked.check(one, None).accepted for one in seen) == (track, box, point)
    if asked.goal_id == 4:
        assert "not found the requested target" in asked.check(seen[0], None).reason


def test_an_exposure_while_the_eyes_turn_is_refused() -> None:
    class Turning:
        def were_still(self, stamp_s: float, skew_s: float, target: TargetEstimate | None) -> bool:
            return stamp_s > 1.0

    gate = StillGate(Turning())  # type: ignore[arg-type]
    assert "turning" in gate.check(sighting(joints(0, HERE), 0.9), None).reason
    assert gate.check(sighting(joints(0, HERE), 1.1), None).accepted


def requested_point() -> RequestedPoint:
    return RequestedPoint(1, joints(0.0, HERE), Kinematics(default_rig()), P, 2.0)


def test_what_lies_beside_or_behind_a_requested_point_is_refused() -> None:
    gate = PointGate(requested_point())
    assert gate.check(sighting(joints(0.005, HERE)), None).accepted
    assert "beside it" in gate.check(sighting(joints(0.05, HERE)), None).reason
    assert "vergence" in gate.check(sighting(joints(0.5 * (FAR - HERE), FAR)), None).reason


@pytest.mark.parametrize(
    ("seen_rad", "moving", "from_s", "to_s"),
    [
        (joints(0.3, HERE), False, 0.0, 0.0),  # aside at its depth: at once
        (joints(0.3, HERE), True, 0.0, 0.0),
        (joints(0.3, NEAR), False, 0.0, 0.0),  # at rest also at another depth
        (joints(0.0, FAR), False, 0.0, 0.0),
        (joints(0.0, FAR), True, 0.3, 0.4),  # of a target that moves: it may be passing another
        (np.array([0.3, math.nan, 0.0]), True, 0.3, 0.4),  # one eye alone sees it elsewhere
        (joints(0.02, HERE), False, 0.0, 0.0),  # in its place
    ],
)
def test_how_long_it_has_to_be_seen_elsewhere(seen_rad: np.ndarray, moving: bool, from_s: float, to_s: float) -> None:
    assert from_s <= first_accepted_s(JumpGate(P), seen_rad, estimate(moving=moving)) <= to_s


@pytest.mark.parametrize("seen_rad", [joints(0.3, HERE), joints(0.3, NEAR), joints(0.0, FAR)])
def test_while_another_source_shows_the_target_in_its_place_it_takes_longest(seen_rad: np.ndarray) -> None:
    gate, target = JumpGate(P), estimate()
    for i in range(40):
        stamp_s = 10.0 + i / 30.0
        assert gate.check(sighting(target.joints_rad, stamp_s + 0.001, "track"), target).accepted
        accepted = gate.check(sighting(seen_rad, stamp_s), target).accepted
        assert accepted == (stamp_s - 10.0 >= P.distractor_persistence_s) or i == 0


def test_seen_in_its_place_again_it_starts_anew() -> None:
    gate, target = JumpGate(P), estimate(moving=True)
    for stamp_s, place, accepted in (
        (0.0, FAR, False),
        (0.3, FAR, False),
        (0.31, HERE, True),
        (0.4, FAR, False),
        (0.7, FAR, False),
        (0.8, FAR, True),
        (2.0, FAR, False),  # after a gap the first
    ):
        assert gate.check(sighting(joints(0.0, place), stamp_s), target).accepted is accepted, stamp_s


def test_of_a_track_whose_depth_jumps_the_direction_counts() -> None:
    gate, target = JumpGate(P), estimate(moving=True)
    verdict = gate.check(sighting(joints(0.5 * (NEAR - HERE), NEAR), source="track"), target)
    assert verdict.accepted
    assert verdict.direction_only
    assert "another depth" in verdict.reason
    aside = gate.check(sighting(joints(0.3, NEAR), 1.03, source="track"), target)
    assert not aside.accepted


def class_gate(*tracks: Sighting) -> ClassGate:
    gate = ClassGate(P)
    for track in tracks:
        gate.check(track, None)
    return gate


@pytest.mark.parametrize(
    ("seen_rad", "confirms"),
    [
        (joints(0.0, HERE), True),
        (joints(0.05, HERE), True),
        (joints(0.2, HERE), False),
        (joints(0.0, HERE, 0.2), False),
        (joints(0.0, FAR), False),
        (np.array([-0.5 * HERE, math.nan, 0.0]), True),  # only the left eye sees it
    ],
    ids=["inside", "at its side", "beside", "below", "deeper", "one eye"],
)
def test_a_box_confirms_the_track_that_it_is_around_in_its_own_pair(seen_rad: np.ndarray, confirms: bool) -> None:
    gate = class_gate(sighting(seen_rad, 1.0, "track"))
    assert not gate.check(sighting(seen_rad, 1.1, "track"), None).accepted
    assert gate.check(sighting(joints(0.0, HERE), 1.05), None).accepted, "boxes pass"
    assert not gate.check(sighting(seen_rad, 1.2, "track"), None).accepted, "another pair's"
    gate.check(sighting(joints(0.0, HERE), 1.1), None)
    assert gate.check(sighting(seen_rad, 1.3, "track"), None).accepted is confirms
    late = gate.check(sighting(seen_rad, 1.1 + P.distractor_persistence_s, "track"), None)
    assert not late.accepted
    assert "no box of the requested class" in late.reason


def test_a_track_that_was_asked_for_counts_from_then_on() -> None:
    gate = class_gate()
    gate.restart(2.0)
    assert gate.check(sighting(joints(0.0, HERE), 2.1, "track"), None).accepted


def test_boxes_of_a_pair_that_the_tracker_has_shown_are_refused() -> None:
    gate = NewerGate()
    assert gate.check(sighting(joints(0.0, HERE), 1.0), None).accepted
    gate.tracked_s = 1.0
    assert not gate.check(sighting(joints(0.0, HERE), 1.0), None).accepted
    assert gate.check(sighting(joints(0.0, HERE), 1.03), None).accepted


odd = st.one_of(st.floats(-3, 3), st.just(math.nan))


@given(st.lists(odd, min_size=3, max_size=3), odd, st.sampled_from(["track", "box"]), st.booleans())
def test_a_refusal_always_says_why(seen: list[float], extent_rad: float, source: str, moving: bool) -> None:
    gates: list[Gate] = [
        ClassGate(P),
        JumpGate(P),
        PointGate(requested_point()),
    ]
    for gate in gates:
        verdict = gate.check(sighting(np.array(seen), 1.0, source, extent_rad), estimate(moving=moving))
        assert verdict.accepted or verdict.reason


def test_the_tracking_reports_the_reason_of_the_gate_that_refused() -> None:
    rig, parameters = default_rig(), gaze_parameters()
    history = ShaftHistory(rig)
    for stamp_s in (0.9, 1.0, 1.1):
        history.add(stamp_s, {"pan_left": -0.04, "pan_right": 0.04, "tilt": 0.0})
    tracking = TargetTracking(Kinematics(rig), parameters, history, JointMoves(rig, history))
    tracking.request_target(1.0, 1.0, np.array([0.0, HERE, 0.0]), np.eye(3) * 1e-6, 3)
    assert tracking.update_track(replace(TRACK, stamp_s=1.05), 1.1)
    assert not tracking.update_track(replace(TRACK, stamp_s=1.06, goal_id=2), 1.1)
    assert tracking.note == "the tracker has not found the requested target yet"
    assert not tracking.update_track(replace(TRACK, stamp_s=1.07, usable=False, reason="it is hidden"), 1.1)
    assert tracking.note == "it is hidden"
    assert not tracking.update_box(BOX, 1.1), "boxes were not asked for"
    assert tracking.note == "it is hidden"
