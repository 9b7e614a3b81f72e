"""Sightings elsewhere: which are a jump at once, which have to stay, and what a track's depth is worth."""

import numpy as np
import pytest

from vergence_gaze.estimation.depth_monitor import DepthMonitor
from vergence_gaze.estimation.distractor_gate import DistractorGate
from vergence_gaze.estimation.target_filter import TargetEstimate

PATIENCE_S = 1.0
EXTENT_RAD = 0.1
OWN_DEPTH_RAD = 0.008
HERE, NEAR, FAR = 0.08, 0.13, 0.04


def estimate(vergence_rad: float = HERE, moving: bool = False, version_rad: float = 0.0) -> TargetEstimate:
    rates = np.array([0.2, 0.0, 0.0]) if moving else np.zeros(3)
    return TargetEstimate(np.array([version_rad, vergence_rad, 0.0]), rates, np.eye(3) * 1e-7, moving)


def joints(version_rad: float, vergence_rad: float) -> np.ndarray:
    return np.array([version_rad - 0.5 * vergence_rad, version_rad + 0.5 * vergence_rad, 0.0])


def first_accepted_s(gate: DistractorGate, place: np.ndarray, target: TargetEstimate, fovea_rad: float | None) -> float:
    """Return after how long a target that is only seen at `place`, at 30 Hz, is taken for the jumped one."""
    for i in range(60):
        stamp_s = 10.0 + i / 30.0
        if fovea_rad is not None:
            gate.update_fovea(stamp_s, fovea_rad, target.joints_rad)
        if gate.accepts(stamp_s, place, EXTENT_RAD, OWN_DEPTH_RAD, target):
            return stamp_s - 10.0
    return np.inf


def gate_that_saw_it_here(target: TargetEstimate) -> DistractorGate:
    gate = DistractorGate(PATIENCE_S)
    for i in range(10):
        gate.update_fovea(9.5 + 0.05 * i, target.vergence_rad, target.joints_rad)
        gate.on_target(9.5 + 0.05 * i, target)
    return gate


@pytest.mark.parametrize(
    ("place", "moving", "fovea_rad", "from_s", "to_s"),
    [
        (joints(0.3, HERE), False, None, 0.0, 0.0),  # aside at its depth: at once
        (joints(0.3, HERE), True, None, 0.0, 0.0),
        (joints(0.3, NEAR), False, None, 0.05, 0.1),  # aside at another depth: a moment
        (joints(0.0, FAR), False, FAR, 0.05, 0.1),  # in place at another depth, and the fovea says so too
        (joints(0.0, FAR), True, FAR, 0.3, 0.4),  # the same of a target that moved: it may be passing
        (joints(0.3, NEAR), False, HERE, 0.95, 1.05),  # the fovea still sees it where it was
        (joints(0.3, HERE), False, HERE, 0.95, 1.05),
        (joints(0.02, HERE), False, HERE, 0.0, 0.0),  # what is seen elsewhere is what the fovea sees
    ],
)
def test_how_long_it_has_to_be_seen_elsewhere(
    place: np.ndarray, moving: bool, fovea_rad: float | None, from_s: float, to_s: float
) -> None:
    target = estimate(moving=moving)
    took_s = first_accepted_s(gate_that_saw_it_here(target), place, target, fovea_rad)
    assert from_s <= took_s <= to_s


def test_what_was_seen_beside_the_target_is_not_the_target() -> None:
    target, aside = estimate(), joints(0.3, NEAR)
    gate = gate_that_saw_it_here(target)
    assert not gate.accepts(9.96, aside, EXTENT_RAD, OWN_DEPTH_RAD, target)
    gate.on_target(9.98, target)  # and the target after it
    assert first_accepted_s(gate, aside, target, None) > 0.95


def test_after_a_jump_the_old_place_is_no_distractor() -> None:
    target, aside = estimate(), joints(0.3, HERE)
    gate = gate_that_saw_it_here(target)
    assert gate.accepts(9.97, aside, EXTENT_RAD, OWN_DEPTH_RAD, target)
    gate.on_target(9.97, estimate(version_rad=0.3))  # accepted: it is there now
    assert first_accepted_s(gate, joints(0.0, HERE), estimate(version_rad=0.3), None) == 0.0


def test_a_track_does_not_jump_in_depth() -> None:
    monitor, target = DepthMonitor(), estimate(moving=True)
    measured = [(0.0, HERE), (0.1, NEAR), (0.6, NEAR), (0.7, HERE), (0.8, NEAR), (1.7, NEAR)]
    sudden = [monitor.is_depth_jump(stamp_s, vergence_rad, OWN_DEPTH_RAD, target) for stamp_s, vergence_rad in measured]
    assert sudden == [False, True, True, False, True, False]


def test_a_track_is_inconsistent_while_its_depth_is_off() -> None:
    monitor, inconsistent = DepthMonitor(), []
    for i, vergence_rad in enumerate((HERE, NEAR, NEAR, HERE)):
        monitor.is_depth_jump(0.1 * i, vergence_rad, OWN_DEPTH_RAD, estimate())
        inconsistent.append(monitor.track_inconsistent)
    assert inconsistent == [False, True, True, False]


@pytest.mark.parametrize(("fovea_rad", "sudden"), [(NEAR, False), (HERE, True)])
def test_of_a_track_at_rest_the_fovea_confirms_the_new_depth(fovea_rad: float, sudden: bool) -> None:
    monitor, target = DepthMonitor(), estimate()
    for i in range(5):
        monitor.update_fovea(i / 30.0, fovea_rad)
        is_sudden = monitor.is_depth_jump(i / 30.0, NEAR, OWN_DEPTH_RAD, target)
    assert is_sudden is sudden
