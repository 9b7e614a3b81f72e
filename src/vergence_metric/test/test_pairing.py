import re
from collections.abc import Iterator
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_metric.pairs import frame_interval
from vergence_metric.pairs.frame_interval import WINDOW, FrameInterval
from vergence_metric.pairs.pairing import JUMP_NS, LEFT, RIGHT, Pair, StereoPairer
from vergence_metric.pairs.parameters import PairingParameters

MS = 1_000_000
PERIOD_NS = 33_333_333


def pairer(slop_ms: float = 20.0, wait_periods: float = 1.0, queue: int = 16) -> StereoPairer[int]:
    return StereoPairer(PairingParameters(slop_s=slop_ms * 1e-3, wait_periods=wait_periods, queue=queue))


def fed(subject: StereoPairer[int], arrivals: list[tuple[int, int]], now_ns: int = 0) -> list[Pair[int]]:
    """Add (side, stamp) frames, each its own stamp, with time standing still."""
    return [pair for side, stamp_ns in arrivals for pair in subject.add(side, stamp_ns, stamp_ns, now_ns)]


def nearest_pairs(left_ns: list[int], right_ns: list[int], slop_ns: int) -> list[tuple[int, int]]:
    """The definition, by brute force over complete streams: of the frames left, the first two nearest to each other."""
    pairs = []
    while left_ns and right_ns:
        mutual = ((a, b) for a in left_ns for b in [nearest(a, right_ns)] if nearest(b, left_ns) == a)
        left, right = next(mutual)
        if abs(left - right) <= slop_ns:
            pairs.append((left, right))
        left_ns = [stamp for stamp in left_ns if stamp > left]
        right_ns = [stamp for stamp in right_ns if stamp > right]
    return pairs


def nearest(stamp_ns: int, others_ns: list[int]) -> int:
    return min(others_ns, key=lambda other: (abs(other - stamp_ns), other))


stamps = st.lists(st.integers(0, 400), min_size=0, max_size=14, unique=True).map(sorted)


@st.composite
def arrivals(draw: st.DrawFn) -> tuple[list[int], list[int], list[tuple[int, int]]]:
    """Two streams, each in order of its stamps, mixed in any order."""
    left, right = draw(stamps), draw(stamps)
    order = draw(st.permutations([LEFT] * len(left) + [RIGHT] * len(right)))
    sources: tuple[Iterator[int], Iterator[int]] = iter(left), iter(right)
    return left, right, [(side, next(sources[side])) for side in order]


@settings(deadline=None, max_examples=300)
@given(arrivals(), st.integers(0, 60))
def test_any_arrival_order_gives_the_nearest_pairs_of_the_whole_streams(
    streams: tuple[list[int], list[int], list[tuple[int, int]]], slop_ns: int
) -> None:
    left, right, mixed = streams
    subject = pairer(slop_ms=slop_ns / MS, queue=100)
    with mock.patch.object(frame_interval, "_ENOUGH", 10**9):  # these stamps have no period to rely on
        found = fed(subject, mixed)
    assert [(p.left, p.right) for p in found] == nearest_pairs(left, right, slop_ns)[: len(found)]
    found += subject.expire(10 * JUMP_NS)
    assert [(p.left, p.right) for p in found] == nearest_pairs(left, right, slop_ns)


@settings(deadline=None, max_examples=300)
@given(
    st.lists(st.tuples(st.sampled_from([LEFT, RIGHT]), st.integers(0, 3 * JUMP_NS), st.integers(0, 50 * MS))),
    st.integers(2, 5),
)
def test_any_frames_at_all_keep_the_order_the_slop_and_the_count(
    frames: list[tuple[int, int, int]], queue: int
) -> None:
    subject, now_ns, epoch = pairer(queue=queue), 0, 0
    found: list[tuple[int, Pair[int]]] = []
    for side, stamp_ns, pause_ns in frames:
        now_ns += pause_ns
        pairs = subject.add(side, stamp_ns, stamp_ns, now_ns)
        epoch = subject.statistics.resets
        found += [(epoch, pair) for pair in pairs]
    for (before, first), (after, second) in pairwise(found):
        if before == after:
            assert second.left_stamp_ns > first.left_stamp_ns
            assert second.right_stamp_ns > first.right_stamp_ns
    for _, pair in found:
        assert abs(pair.skew_ns) <= 20 * MS
        assert (pair.left, pair.right) == (pair.left_stamp_ns, pair.right_stamp_ns)
    counts = subject.statistics
    assert counts.pairs == len(found)
    for side in (LEFT, RIGHT):
        gone = counts.pairs + counts.unmatched[side] + counts.late[side]
        waiting = counts.received[side] - gone
        assert 0 <= waiting <= queue
        assert counts.received[side] == sum(frame[0] == side for frame in frames)


def test_equal_stamps_pair_at_once_even_without_slop() -> None:
    subject = pairer(slop_ms=0.0)
    assert fed(subject, [(LEFT, 5)]) == []
    assert fed(subject, [(RIGHT, 5)]) == [Pair(5, 5, 5, 5)]
    assert subject.deadline_ns is None


@pytest.mark.parametrize("late", [LEFT, RIGHT])
def test_slop_is_inclusive(late: int) -> None:
    subject = pairer(slop_ms=20.0)
    fed(subject, [(1 - late, 100), (late, 100 + 20 * MS)])
    assert len(subject.expire(JUMP_NS)) == 1
    subject = pairer(slop_ms=20.0)
    fed(subject, [(1 - late, 100), (late, 101 + 20 * MS)])
    assert subject.expire(JUMP_NS) == []


def test_the_nearer_later_frame_wins() -> None:
    # a greedy queue gives (0, -20) here
    assert [(p.left, p.right) for p in fed(pairer(), [(RIGHT, 80 * MS), (LEFT, 100 * MS), (RIGHT, 101 * MS)])] == []
    subject = pairer()
    found = fed(subject, [(RIGHT, 80 * MS), (LEFT, 100 * MS), (RIGHT, 101 * MS), (LEFT, 133 * MS)])
    assert [(p.left, p.right) for p in found] == [(100 * MS, 101 * MS)]
    assert subject.statistics.unmatched == [0, 1]


@pytest.mark.parametrize(("skew_ms", "waits"), [(5.0, False), (14.0, False), (16.5, True)])
def test_a_known_period_releases_a_close_pair_at_once_and_makes_a_far_one_wait(skew_ms: float, waits: bool) -> None:
    subject, at_once = pairer(), []
    for i in range(60):
        jitter_ns = (i % 3 - 1) * MS // 2
        subject.add(LEFT, i * PERIOD_NS + jitter_ns, 0, i * PERIOD_NS)
        right_ns = i * PERIOD_NS + round(skew_ms * MS)
        at_once.append(len(subject.add(RIGHT, right_ns, 0, right_ns)))
    assert at_once[30:] == [0 if waits else 1] * 30
    assert (subject.deadline_ns is not None) is waits


def test_a_pair_that_waits_is_released_at_its_deadline() -> None:
    subject = pairer(wait_periods=0.5)
    for i in range(5):
        subject.add(LEFT, i * PERIOD_NS, i, i * PERIOD_NS)
    right_ns = 4 * PERIOD_NS + 16 * MS
    assert subject.add(RIGHT, right_ns, 99, right_ns) == []
    deadline_ns = subject.deadline_ns
    assert deadline_ns == right_ns + round(0.5 * PERIOD_NS)
    assert subject.expire(deadline_ns - 1) == []
    assert [(p.left, p.right) for p in subject.expire(deadline_ns)] == [(4, 99)]
    assert subject.deadline_ns is None


def test_the_time_limit_follows_a_slow_replay() -> None:
    subject = pairer(wait_periods=1.0)
    for i in range(10):
        subject.add(LEFT, i * PERIOD_NS, i, 10 * i * PERIOD_NS)
    now_ns = 90 * PERIOD_NS
    subject.add(RIGHT, 9 * PERIOD_NS + 16 * MS, 0, now_ns)
    assert subject.deadline_ns == now_ns + 10 * PERIOD_NS


@pytest.mark.parametrize(("jump_ns", "resets"), [(-30 * JUMP_NS, 1), (30 * JUMP_NS, 0)])
def test_both_clocks_jump(jump_ns: int, resets: int) -> None:
    subject = pairer()
    fed(subject, [(side, 100 * JUMP_NS + i * PERIOD_NS) for i in range(5) for side in (LEFT, RIGHT)])
    start_ns = 100 * JUMP_NS + 5 * PERIOD_NS + jump_ns
    found = fed(subject, [(side, start_ns + i * PERIOD_NS) for i in range(5) for side in (LEFT, RIGHT)])
    assert len(found) == 5
    assert subject.statistics.resets == resets


def test_a_clock_set_back_a_little_recovers_after_three_frames() -> None:
    subject = pairer()
    fed(subject, [(side, i * PERIOD_NS) for i in range(30) for side in (LEFT, RIGHT)])
    start_ns = 20 * PERIOD_NS
    found = fed(subject, [(side, start_ns + i * PERIOD_NS) for i in range(8) for side in (LEFT, RIGHT)])
    assert found[-1].left == start_ns + 7 * PERIOD_NS
    assert len(found) >= 5


def test_a_repeated_or_late_frame_is_refused_and_counted() -> None:
    subject = pairer()
    found = fed(subject, [(LEFT, 50), (LEFT, 50), (LEFT, 40), (LEFT, 60), (RIGHT, 60)])
    assert [(p.left, p.right) for p in found] == [(60, 60)]
    assert subject.statistics.late == [2, 0]
    assert subject.statistics.unmatched == [1, 0]


def test_one_camera_restarts_and_pairs_again() -> None:
    subject = pairer()
    fed(subject, [(side, i * PERIOD_NS) for i in range(5) for side in (LEFT, RIGHT)])
    fed(subject, [(LEFT, i * PERIOD_NS) for i in range(5, 100)])
    found = fed(subject, [(side, i * PERIOD_NS) for i in range(100, 105) for side in (LEFT, RIGHT)])
    assert len(found) == 5
    assert subject.statistics.resets == 0


def test_statistics_give_the_reason_why_there_is_no_pair() -> None:
    subject = pairer(slop_ms=10.0)
    fed(subject, [(side, i * PERIOD_NS + side * 14 * MS) for i in range(20) for side in (LEFT, RIGHT)])
    assert subject.statistics.pairs == 0
    assert (
        subject.statistics.complaint(0.01) == "no pair since the start: median skew is 14 ms, pair.slop_s allows 10 ms"
    )


def test_statistics_give_no_reason_while_there_are_pairs_or_one_stream_has_no_frames() -> None:
    subject = pairer()
    fed(subject, [(LEFT, i * PERIOD_NS) for i in range(40)])
    assert subject.statistics.complaint(0.02) is None
    fed(subject, [(side, i * PERIOD_NS) for i in range(40, 60) for side in (LEFT, RIGHT)])
    assert subject.statistics.complaint(0.02) is None
    assert subject.statistics.skew_median_s == 0.0


def test_a_skew_of_ten_seconds_is_named_too() -> None:
    subject = pairer()
    fed(subject, [(side, i * PERIOD_NS + side * 10 * JUMP_NS) for i in range(20) for side in (LEFT, RIGHT)])
    complaint = subject.statistics.complaint(0.02)
    assert complaint is not None
    assert re.fullmatch(
        r"no pair since the start: median skew is (9[4-9]\d\d|10000) ms, pair.slop_s allows 20 ms", complaint
    )


def test_interval_ignores_loss_and_guards_against_jitter() -> None:
    random = np.random.default_rng(1)
    stamps_ns = np.arange(2000) * PERIOD_NS + random.normal(0.0, MS, 2000).astype(int)
    kept = stamps_ns[random.random(2000) > 0.02]
    interval, violated = FrameInterval(), 0
    for step_ns in np.diff(kept).tolist():
        violated += interval.earliest_ns > step_ns
        interval.add(step_ns)
    assert interval.period_ns == pytest.approx(PERIOD_NS, rel=0.02)
    assert 0.6 * PERIOD_NS < interval.earliest_ns < 0.95 * PERIOD_NS
    assert violated <= 2


def test_interval_forgets_a_period_that_is_over() -> None:
    interval = FrameInterval()
    for step_ns in [PERIOD_NS] * WINDOW + [2 * PERIOD_NS] * WINDOW:
        interval.add(step_ns)
    assert interval.period_ns == 2 * PERIOD_NS
    assert interval.earliest_ns == pytest.approx(2 * PERIOD_NS, rel=0.02)


def test_interval_is_careful_at_first() -> None:
    interval, earliest = FrameInterval(), []
    for _ in range(WINDOW):
        interval.add(PERIOD_NS)
        earliest.append(interval.earliest_ns)
    assert earliest[:3] == [0, 0, 0]
    assert 0.6 * PERIOD_NS < earliest[3] < earliest[10] < earliest[63] < PERIOD_NS


def test_free_running_jittered_lossy_streams_pair_with_the_true_nearest() -> None:
    random = np.random.default_rng(2)
    n = 3000
    left = np.arange(n) * PERIOD_NS + random.normal(0, 0.4 * MS, n)
    right = np.arange(n) * round(PERIOD_NS * 1.0007) + random.normal(0, 0.4 * MS, n)
    frames = [(int(s + random.normal(5, 1) * MS), LEFT, int(s)) for s in left[random.random(n) > 0.02]]
    frames += [(int(s + random.normal(5, 1) * MS), RIGHT, int(s)) for s in right[random.random(n) > 0.02]]
    subject = pairer()
    found: list[Pair[int]] = []
    for now_ns, side, stamp_ns in sorted(frames):
        if subject.deadline_ns is not None and subject.deadline_ns < now_ns:
            found += subject.expire(subject.deadline_ns)
        found += subject.add(side, stamp_ns, stamp_ns, now_ns)
    found += subject.expire(10**15)
    lefts = sorted(s for _, side, s in frames if side == LEFT)
    rights = sorted(s for _, side, s in frames if side == RIGHT)
    assert {(p.left, p.right) for p in found} == set(nearest_in_blocks(lefts, rights))


def nearest_in_blocks(left: list[int], right: list[int]) -> list[tuple[int, int]]:
    """`nearest_pairs` without its quadratic cost: only frames of the next ten periods can matter."""
    pairs: list[tuple[int, int]] = []
    while left and right:
        pair = nearest_pairs_first(left[:12], right[:12])
        if abs(pair[0] - pair[1]) <= 20 * MS:
            pairs.append(pair)
        left, right = [s for s in left if s > pair[0]], [s for s in right if s > pair[1]]
    return pairs


def nearest_pairs_first(left: list[int], right: list[int]) -> tuple[int, int]:
    return next((a, b) for a in left for b in [nearest(a, right)] if nearest(b, left) == a)
