import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.geometry import EyeAngles
from vergence_rig.joint_history import JointHistory, interpolated

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


def test_without_joint_states_nothing_is_assumed() -> None:
    assert JointHistory().at(5, 6) is None
    assert "no usable joint_states" in JointHistory().gap(5)
    assert turning().gap(350 * MS) == "no joint_states at the image's stamp: the newest is 0.25 s older"
    assert turning().gap(-500 * MS) == "joint_states begin 0.50 s after the image"


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


def test_the_states_between_two_stamps_are_given_in_order_and_the_one_that_follows() -> None:
    between = turning().samples_between(30 * MS, 55 * MS)
    assert [stamp_ns for stamp_ns, _ in between] == [40 * MS, 50 * MS, 60 * MS]
    assert between[0][1] == EyeAngles(0.04, -0.08, 0.02)
    assert JointHistory().samples_between(0, 100 * MS) == []


@pytest.mark.parametrize("odd", [float("nan"), float("inf")])
def test_a_state_with_an_angle_that_is_no_number_is_ignored(odd: float) -> None:
    history = turning()
    assert not history.add(200 * MS, NAMES, (0.0, odd, 0.0))
    assert history.newest.stamp == 100 * MS


def test_a_second_state_of_one_stamp_is_ignored() -> None:
    history = turning()
    assert not history.add(100 * MS, NAMES, (1.0, 1.0, 1.0))
    eyes = history.at(100 * MS, 100 * MS)
    assert eyes is not None
    assert eyes.pan_left_rad == pytest.approx(0.1)


def test_seconds_serve_as_stamps_too() -> None:
    history = JointHistory(keep=1.0, hold=0.1)
    for i in range(30):
        history.add(0.1 * i, NAMES, (0.0, 0.2 * i, 0.0))
    assert history.covers(2.0)
    assert not history.covers(1.5)
    before, after = history.bracket(2.05)
    assert (before.stamp, after.stamp) == (2.0, 2.1)
    assert interpolated(before, after, 2.05)[0] == pytest.approx(4.1)


@pytest.mark.parametrize(
    ("begin", "end", "stamps"),
    [(15, 35, [10, 20, 30, 40]), (20, 30, [20, 30]), (-5, 5, [0, 10]), (95, 300, [90, 100])],
)
def test_a_span_takes_in_the_states_that_enclose_it(begin: int, end: int, stamps: list[int]) -> None:
    assert [sample.stamp for sample in turning().spanning(begin * MS, end * MS)] == [stamp * MS for stamp in stamps]


def test_beyond_an_end_that_end_brackets() -> None:
    history = turning()
    assert [sample.stamp for sample in history.bracket(-1)] == [0, 0]
    assert [sample.stamp for sample in history.bracket(200 * MS)] == [100 * MS] * 2
    history.clear()
    assert not history.known
