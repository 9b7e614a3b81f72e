"""ROS stamps from capture times on either clock, whatever the clocks do."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_camera import stamps
from vergence_camera.frame import Clock, Encoding, Frame
from vergence_camera.stamps import Stamper


class Clocks:
    """A machine's clocks, set by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.monotonic_ns, self.wall_ns, self.ros_ns = 10**12, 1_700_000_000 * 10**9, 5 * 10**9
        monkeypatch.setattr(Clock.MONOTONIC, "now_ns", lambda: self.monotonic_ns)
        monkeypatch.setattr(Clock.WALL, "now_ns", lambda: self.wall_ns)

    def advance(self, ns: int) -> None:
        self.monotonic_ns += ns
        self.wall_ns += ns
        self.ros_ns += ns

    def now(self, clock: Clock) -> int:
        return self.monotonic_ns if clock is Clock.MONOTONIC else self.wall_ns


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Clocks:
    return Clocks(monkeypatch)


def frame_at(time_ns: int, clock: Clock = Clock.MONOTONIC) -> Frame:
    return Frame(b"", Encoding.JPEG, 1, 1, time_ns, clock, 0)


@pytest.mark.parametrize("clock", list(Clock))
def test_a_frames_age_is_taken_from_ros_time(clocks: Clocks, clock: Clock) -> None:
    stamper = Stamper(lambda: clocks.ros_ns)
    stamp = stamper.stamp(frame_at(clocks.now(clock) - 7_000_000, clock))
    assert (stamp.ros_ns, stamp.age_ns) == (clocks.ros_ns - 7_000_000, 7_000_000)


def test_the_measured_offset_is_subtracted(clocks: Clocks) -> None:
    stamp = Stamper(lambda: clocks.ros_ns).stamp(frame_at(clocks.monotonic_ns - 1_000_000), offset_s=0.02)
    assert (stamp.ros_ns, stamp.age_ns) == (clocks.ros_ns - 21_000_000, 21_000_000)


def test_a_stepped_wall_clock_is_followed_at_the_next_frame(clocks: Clocks) -> None:
    """The conversion is made afresh: a monotonic capture time does not inherit an old difference of the clocks."""
    stamper = Stamper(lambda: clocks.ros_ns)
    stamper.stamp(frame_at(clocks.monotonic_ns))
    clocks.advance(33_000_000)
    clocks.ros_ns += 10**9
    assert stamper.stamp(frame_at(clocks.monotonic_ns - 1000)).ros_ns == clocks.ros_ns - 1000


def test_time_that_jumps_back_is_followed_and_counted(clocks: Clocks) -> None:
    stamper = Stamper(lambda: clocks.ros_ns)
    stamper.stamp(frame_at(clocks.monotonic_ns))
    clocks.ros_ns -= 10**9
    assert stamper.stamp(frame_at(clocks.monotonic_ns)).ros_ns == clocks.ros_ns
    assert (stamper.clock_jumps, stamper.pushed_forward) == (1, 0)


def test_a_capture_time_in_the_future_counts_as_now(clocks: Clocks) -> None:
    assert Stamper(lambda: clocks.ros_ns).stamp(frame_at(clocks.monotonic_ns + 5000)).ros_ns == clocks.ros_ns


@settings(deadline=None, max_examples=200)
@given(st.lists(st.tuples(st.integers(0, 10**8), st.integers(0, 10**8)), min_size=2, max_size=40))
def test_stamps_strictly_increase_as_long_as_time_does(steps: list[tuple[int, int]]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        clocks = Clocks(patch)
        stamper = Stamper(lambda: clocks.ros_ns)
        result = []
        for step_ns, age_ns in steps:
            clocks.advance(step_ns)
            result.append(stamper.stamp(frame_at(clocks.monotonic_ns - age_ns)).ros_ns)
    assert all(before < after for before, after in itertools.pairwise(result))


def test_an_interrupted_reading_is_made_again(clocks: Clocks) -> None:
    """If the process loses the CPU between the two clocks, the pair of readings is worthless."""
    readings = itertools.count()

    def interrupted_once() -> int:
        if next(readings) == 0:
            clocks.advance(50_000_000)
        return clocks.ros_ns

    stamp = Stamper(interrupted_once).stamp(frame_at(clocks.monotonic_ns))
    assert stamp.age_ns == 50_000_000
    assert next(readings) == 2


def test_without_a_steady_reading_the_best_is_taken(clocks: Clocks) -> None:
    delays = iter([9_000_000, 4_000_000, 6_000_000])

    def always_interrupted() -> int:
        clocks.advance(next(delays))
        return clocks.ros_ns

    captured_ns = clocks.monotonic_ns
    stamp = Stamper(always_interrupted).stamp(frame_at(captured_ns))
    assert stamp.age_ns == 9_000_000 + 2_000_000
    assert stamps._STEADY_READING_NS < 4_000_000
