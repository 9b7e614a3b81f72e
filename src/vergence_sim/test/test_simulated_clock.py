"""The law of simulated time: never back, never ahead of those who follow, never too fast, never stopped for ever."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_sim.clock_parameters import ClockParameters
from vergence_sim.simulated_clock import PAIRS, TICKS, Follower, Sequence, SimulatedClock

STEP_NS = 20_000_000
FREE = ClockParameters(real_time_factor=0.0)
FOLLOWERS = {"control": TICKS, "metric": PAIRS}


def clock_of(parameters: ClockParameters = FREE) -> SimulatedClock:
    return SimulatedClock(parameters, FOLLOWERS, start_ns=0, skew_ns=25_000_000)


def sequence_of(count: int) -> Sequence:
    sequence = Sequence()
    for number in range(1, count + 1):
        sequence.add(number * STEP_NS)
    return sequence


@given(st.lists(st.tuples(st.sampled_from(["tick", "control", "left", "right", "metric", "wait"]), st.integers(0, 9))))
def test_time_never_runs_back_and_no_known_output_is_left_behind(events: list[tuple[str, int]]) -> None:
    clock, wall_s, images_ns = clock_of(), 0.0, {"left": 0, "right": 0}
    for event, number in events:
        before_ns = clock.now_ns
        if event == "tick" and clock.may_advance(wall_s):
            assert not clock.due
            clock.advance(wall_s)
        elif event in images_ns:
            images_ns[event] += 33_000_000 + number * 1_000_000
            clock.add_image(event, images_ns[event], 0.0)
        elif event == "control":
            clock.answer("control", clock.now_ns, 0.0)
        elif event == "metric":
            clock.answer("metric", images_ns["left"] - number * 33_000_000, wall_s)
        elif event == "wait":
            wall_s += number
        assert clock.now_ns - before_ns in (0, STEP_NS)
        assert event == "tick" or clock.now_ns == before_ns


def unanswered(clock: SimulatedClock, ticks: int, every: int, delays_s: list[float]) -> list[int]:
    """Run beside one who answers every so many ticks, each after a delay, the last few at once.

    It leaves out what it has not begun when the next is there. Return the ticks left out or not answered in time.
    """
    wall_s, busy_until_s, begun, missed = 0.0, 0.0, 0, []
    delays_s = delays_s[::-1]
    for number in range(1, ticks + 1):
        while True:
            if begun and wall_s >= busy_until_s:
                clock.answer("control", begun * STEP_NS, wall_s)
                begun = 0
            if clock.may_advance(wall_s):
                break
            wall_s += 0.01
        clock.advance(wall_s)
        if number % every == 0:
            if begun:
                missed.append(number)
            else:
                begun, busy_until_s = number, wall_s + (delays_s.pop() if delays_s else 0.05)
        wall_s += 0.001
    return missed


@settings(deadline=None, max_examples=50)
@given(st.integers(1, 5), st.lists(st.floats(0.0, 1.0), max_size=20))
def test_time_comes_to_wait_for_every_answer_of_one_who_was_slow(every: int, delays_s: list[float]) -> None:
    clock = clock_of(ClockParameters())
    ticks = 60 * every + round(50 * sum(delays_s))
    missed = unanswered(clock, ticks, every, delays_s)
    assert clock.given_up == []
    assert [number for number in missed if number > ticks - 20 * every] == []


@given(st.floats(0.1, 10.0), st.integers(0, 20))
def test_one_who_has_died_is_named_after_the_timeout_and_time_goes_on(timeout_s: float, more: int) -> None:
    clock = clock_of(ClockParameters(real_time_factor=0.0, timeout_s=timeout_s))
    for _ in range(4):
        clock.advance(0.0)
        clock.answer("control", clock.now_ns, 0.0)
    clock.advance(0.0)
    assert clock.due == ["control"]
    assert not clock.may_advance(0.0)
    assert not clock.may_advance(0.99 * timeout_s)
    assert clock.given_up == []
    assert clock.may_advance(timeout_s)
    assert clock.given_up == ["control"]
    for _ in range(more):
        assert clock.may_advance(timeout_s)
        clock.advance(timeout_s)
    # Back again: it is no longer named at once, and waited for when its interval is known again.
    clock.answer("control", clock.now_ns, 0.0)
    assert clock.given_up == []
    clock.advance(timeout_s)
    assert clock.due == []
    clock.answer("control", clock.now_ns, 0.0)
    clock.advance(timeout_s)
    assert clock.due == ["control"]


@given(st.floats(0.05, 20.0), st.lists(st.floats(0.0, 0.5), min_size=1, max_size=60))
def test_time_is_never_faster_than_it_may_be(factor: float, pauses_s: list[float]) -> None:
    clock, wall_s = clock_of(ClockParameters(real_time_factor=factor)), 0.0
    passed = [(0.0, 0)]
    for pause_s in pauses_s:
        wall_s += pause_s
        if clock.may_advance(wall_s):
            clock.advance(wall_s)
            passed.append((wall_s, clock.now_ns))
    for begin_s, begin_ns in passed:
        for end_s, end_ns in passed:
            if end_s >= begin_s:
                assert (end_ns - begin_ns) * 1e-9 <= factor * (end_s - begin_s + 0.1) + 2.5 * STEP_NS * 1e-9


@pytest.mark.parametrize(
    ("answers", "interval"),
    [
        ([1], None),
        ([1, 2], 1),
        ([1, 3, 5, 7], 2),
        ([1, 3, 6, 8, 11], 3),  # a rate that does not divide the sequence's
        ([1, 2, 9, 10, 11, 12, 13], 1),
    ],
)
def test_the_interval_is_learnt_from_the_answers(answers: list[int], interval: int | None) -> None:
    sequence, follower = Sequence(), None
    for number in range(1, answers[-1] + 1):
        sequence.add(number * STEP_NS)
        follower = follower or Follower(sequence)
        if number in answers:
            follower.answer(number, 0.0)
    assert follower is not None
    assert follower.interval == interval
    assert not follower.waits(0.0, 5.0)


def test_what_a_busy_one_leaves_out_is_not_taken_for_its_interval() -> None:
    sequence = sequence_of(1)
    follower = Follower(sequence)
    for number, answered in ((9, 1), (17, 10), (25, 18)):
        sequence.add(number * STEP_NS)
        for more in range(number, number + 8):
            sequence.add(more * STEP_NS)
        follower.answer(answered, 0.0)
    assert follower.interval is None


def test_an_answer_that_may_come_is_given_a_moment_and_one_that_is_due_the_timeout() -> None:
    sequence = Sequence()
    follower = Follower(sequence)
    for number in range(1, 9):
        sequence.add(number * STEP_NS)
        if number in (1, 3, 6, 8):
            follower.answer(number, 0.0)
    for number, wall_s, waits in ((9, 1.0, True), (9, 1.3, False), (10, 2.0, True), (10, 2.3, False), (11, 3.0, True)):
        sequence.add(number * STEP_NS)
        assert follower.waits(wall_s, 5.0) is waits
    follower.answer(11, 3.1)
    # One less than the shortest has just been tried in vain.
    sequence.add(12 * STEP_NS)
    assert not follower.waits(6.0, 5.0)
    for number, wall_s, waits in ((13, 7.0, True), (14, 9.0, True), (14, 13.9, True), (14, 14.1, False)):
        sequence.add(number * STEP_NS)
        assert follower.waits(wall_s, 5.0) is waits
    assert follower.given_up


def test_an_answer_may_come_before_its_pair_is_noted() -> None:
    clock = clock_of()
    for number in range(1, 5):
        left_ns = number * 50_000_000
        clock.add_image("left", left_ns, 0.0)
        clock.answer("metric", left_ns, 0.0)
        clock.add_image("right", left_ns + 7_000_000, 0.0)
        assert clock.may_advance(0.0)
    assert clock.due == []


def test_a_pair_is_two_images_of_nearly_one_time() -> None:
    clock = clock_of()
    for number in range(1, 4):
        left_ns = number * 50_000_000
        clock.add_image("left", left_ns, 0.0)
        assert clock.due == []
        clock.add_image("right", left_ns + 7_000_000, 0.0)
        assert clock.due == ([] if number < 3 else ["metric"])
        clock.answer("metric", left_ns, 0.0)
    clock.add_image("left", 200_000_000, 0.0)
    clock.add_image("right", 250_000_000, 0.0)
    assert clock.due == []


def test_stepped_time_stands_until_it_is_let_go_on() -> None:
    clock = clock_of(ClockParameters(real_time_factor=0.0, stepped=True))
    assert clock.at_limit
    assert not clock.may_advance(0.0)
    clock.run_until(30_000_000)
    while clock.may_advance(0.0):
        clock.advance(0.0)
    assert clock.now_ns == 40_000_000
    assert clock.at_limit


def test_one_whose_publisher_has_gone_is_not_waited_for() -> None:
    clock = clock_of()
    for _ in range(3):
        clock.advance(0.0)
        clock.answer("control", clock.now_ns, 0.0)
    clock.advance(0.0)
    assert clock.due == ["control"]
    clock.forget("control")
    assert clock.may_advance(0.0)
    assert clock.given_up == []


def test_the_rate_is_of_the_last_seconds_and_zero_where_time_stands() -> None:
    clock = clock_of()
    for number in range(100):
        clock.advance(number * 0.04)
    assert clock.rate(99 * 0.04) == pytest.approx(0.5)
    assert clock.rate(20.0) == 0.0


def test_an_image_between_two_of_the_other_eye_is_in_one_pair() -> None:
    clock, ms = clock_of(), 1_000_000
    for number in range(1, 5):
        # 24 ms after the left image and 24 ms before the next one: the metric pairs it with one of them.
        clock.add_image("left", number * 48 * ms, 0.0)
        clock.answer("metric", number * 48 * ms, 0.0)
        clock.add_image("right", number * 48 * ms + 24 * ms, 0.0)
    clock.add_image("left", 5 * 48 * ms, 0.0)
    assert not clock.due
