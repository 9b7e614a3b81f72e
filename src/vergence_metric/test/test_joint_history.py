import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.pairs.joint_history import JointHistory
from vergence_rig.geometry import EyeAngles

NAMES = ("tilt", "pan_left", "pan_right")
MS = 1_000_000


def turning(samples: int = 11, step_ns: int = 10 * MS) -> JointHistory:
    """Pan left 1 rad/s, pan right -2 rad/s, tilt 0.5 rad/s, from time 0."""
    history = JointHistory()
    for i in range(samples):
        t = i * step_ns * 1e-9
        assert history.add(i * step_ns, NAMES, (0.5 * t, t, -2.0 * t))
    return history


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 100 * MS), st.integers(0, 100 * MS))
def test_each_eye_is_read_at_its_own_stamp(left_ns: int, right_ns: int) -> None:
    eyes = turning().at(left_ns, right_ns)
    assert eyes is not None
    assert eyes.pan_left_rad == pytest.approx(left_ns * 1e-9, abs=1e-12)
    assert eyes.tilt_rad == pytest.approx(0.5 * left_ns * 1e-9, abs=1e-12)
    assert eyes.pan_right_rad == pytest.approx(-2.0 * right_ns * 1e-9, abs=1e-12)


def test_a_head_that_never_told_its_joints_looks_straight_ahead() -> None:
    assert JointHistory().at(5, 6) == EyeAngles(0.0, 0.0, 0.0)


def test_shortly_after_the_newest_sample_it_is_held_and_long_after_nothing_is_known() -> None:
    history = turning()
    held = history.at(150 * MS, 150 * MS)
    assert held is not None
    assert held.pan_left_rad == pytest.approx(0.1)
    assert history.at(301 * MS, 301 * MS) is None
    assert history.at(-1, 0) is None


def test_a_state_without_all_joints_is_ignored() -> None:
    history = turning()
    assert not history.add(200 * MS, ("pan_left", "neck"), (1.0, 2.0))
    assert not history.add(200 * MS, NAMES, (1.0, 2.0))
    assert history.at(100 * MS, 100 * MS) is not None


def test_a_clock_that_goes_back_begins_anew() -> None:
    history = turning()
    history.add(-1000 * MS, NAMES, (0.0, 0.25, 0.0))
    eyes = history.at(-1000 * MS, -1000 * MS)
    assert eyes is not None
    assert eyes.pan_left_rad == 0.25
    assert history.at(50 * MS, 50 * MS) is None


def test_the_past_is_forgotten_after_a_while() -> None:
    history = turning(samples=400)
    assert history.at(1000 * MS, 1000 * MS) is None
    assert history.at(2500 * MS, 2500 * MS) is not None


def test_what_was_told_between_two_stamps_is_given_in_order() -> None:
    told = turning().told_between(30 * MS, 60 * MS)
    assert [stamp_ns for stamp_ns, _ in told] == [40 * MS, 50 * MS]
    assert told[0][1] == EyeAngles(0.04, -0.08, 0.02)
    assert JointHistory().told_between(0, 100 * MS) == []
