"""What the reader of joint_states refuses, what it counts, and how it merges joints of several messages."""

import math
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_rig.joint_reader import JointStateReader, MergedJoints
from vergence_rig.report import ERROR, OK, WARN
from vergence_rig.rig import JOINT_NAMES

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000


def read(reader: JointStateReader, ms: float, names: Any, positions: Any, clock_ms: float | None = None) -> Any:
    clock_ns = BEGIN + round((ms if clock_ms is None else clock_ms) * MS)
    return reader.read(
        BEGIN + round(ms * MS), names, positions, clock_ns, (ms if clock_ms is None else clock_ms) * 1e-3
    )


def test_a_message_with_all_joints_is_passed_on_as_it_is() -> None:
    reader = JointStateReader()
    merged = read(reader, 0, ("tilt", "neck", "pan_right", "pan_left"), (0.3, 9.0, 0.2, 0.1))
    assert merged == MergedJoints(BEGIN, (0.1, 0.2, 0.3))
    assert reader.report(0.0).level == OK


@pytest.mark.parametrize(
    ("names", "positions", "kind", "text"),
    [
        (("elbow", "wrist"), (1.0, 2.0), "foreign_names", "got elbow, wrist"),
        ((), (), "foreign_names", "got no name"),
        (JOINT_NAMES, (), "no_positions", "velocities or efforts alone"),
        (JOINT_NAMES, (0.1, 0.2), "sizes", "got 2 for 3 names"),
        (("pan_left", "pan_left"), (0.1, 0.2), "names_twice", "named twice"),
        (JOINT_NAMES, (0.1, math.nan, 0.2), "not_finite", "pan_right must be a finite angle: got nan"),
        (JOINT_NAMES, (0.1, 0.2, -math.inf), "not_finite", "tilt must be a finite angle: got -inf"),
        (JOINT_NAMES, (20.0, 0.2, 0.0), "too_large", "pan_left must be -2 pi to 2 pi"),
    ],
)
def test_what_is_refused_is_counted_and_named(names: Any, positions: Any, kind: str, text: str) -> None:
    reader = JointStateReader()
    assert read(reader, 0, names, positions) is None
    assert reader.refused == {kind: 1}
    assert text in reader.problem(0.0)
    report = reader.report(0.0)
    assert (report.level, report.values[f"refused_{kind}"]) == (ERROR, 1)
    assert text in report.message
    # One such message among good ones is a warning that ends.
    for ms in range(20, 5000, 20):
        assert read(reader, ms, JOINT_NAMES, (0.0, 0.0, 0.0)) is not None
    assert reader.report(5.0).level == OK
    assert read(reader, 5001, names, positions) is None
    assert reader.report(5.0).level == (OK if kind == "foreign_names" else WARN)


def test_stamps_at_zero_in_the_future_and_backwards_are_refused() -> None:
    reader = JointStateReader()
    still = (0.1, 0.2, 0.3)
    assert reader.read(0, JOINT_NAMES, still, BEGIN, 0.0) is None
    assert "zero" in reader.problem(0.0)
    assert read(reader, 400, JOINT_NAMES, still, clock_ms=0) is None
    assert "0.4 s ahead of the clock" in reader.problem(0.0)
    assert read(reader, 100, JOINT_NAMES, still) is not None
    assert read(reader, 100, JOINT_NAMES, still) is None
    assert read(reader, 80, JOINT_NAMES, still, clock_ms=101) is None
    assert reader.refused == {"zero_stamp": 1, "future_stamp": 1, "repeated_stamp": 1, "backward_stamp": 1}
    assert reader.report(0.1).level == WARN
    assert read(reader, 120, JOINT_NAMES, still) is not None


def test_a_clock_without_time_makes_no_stamp_a_future_one() -> None:
    assert JointStateReader().read(BEGIN, JOINT_NAMES, (0.0, 0.0, 0.0), 0, 0.0) is not None


def test_a_stray_old_message_is_refused_and_a_clock_set_back_starts_again() -> None:
    reader = JointStateReader()
    read(reader, 10_000, JOINT_NAMES, (0.1, 0.2, 0.3))
    assert read(reader, 0, JOINT_NAMES, (9.0, 0.0, 0.0), clock_ms=10_010) is None
    assert read(reader, 10_020, JOINT_NAMES, (0.1, 0.2, 0.3)) is not None
    results = [read(reader, 20 * i, JOINT_NAMES, (0.5, 0.5, 0.5)) for i in range(4)]
    assert [result is not None for result in results] == [False, False, True, True]


@settings(max_examples=50, deadline=None)
@given(st.integers(5, 50), st.integers(0, 50), st.permutations(JOINT_NAMES), st.booleans())
def test_joints_of_two_messages_are_merged_on_their_lines(
    period_ms: int, behind_ms: int, names: list[str], second_first: bool
) -> None:
    behind_ms = min(behind_ms, period_ms - 1)
    reader, rates = JointStateReader(), dict(zip(names, (1.0, -2.0, 0.5), strict=True))
    messages = []
    for i in range(20):
        for offset_ms, part in ((0, names[:2]), (behind_ms, names[2:])):
            messages.append((i * period_ms + offset_ms, part))
    if second_first and behind_ms == 0:
        messages[0::2], messages[1::2] = messages[1::2], messages[0::2]
    merged = []
    for ms, part in messages:
        got = read(reader, ms, part, [rates[name] * ms * 1e-3 for name in part])
        if got is not None:
            merged.append(got)
    assert len(merged) >= 18
    assert all(b.stamp_ns > a.stamp_ns for a, b in pairwise(merged))
    for got in merged[3:]:
        passed_s = (got.stamp_ns - BEGIN) * 1e-9
        for name, rad in zip(JOINT_NAMES, got.angles_rad, strict=True):
            assert rad == pytest.approx(rates[name] * passed_s, abs=1e-9)
    assert not reader.refused


def test_nothing_is_passed_on_until_every_joint_is_known() -> None:
    reader = JointStateReader()
    assert read(reader, 0, ("pan_left", "pan_right"), (0.1, 0.2)) is None
    assert reader.problem(0.0) == "joint_states lack tilt"
    assert reader.report(0.0).level == ERROR
    assert read(reader, 5, ("tilt",), (0.3,)) == MergedJoints(BEGIN + 5 * MS, (0.1, 0.2, 0.3))


def test_a_joint_that_is_reported_once_keeps_its_angle_and_is_named() -> None:
    reader = JointStateReader()
    read(reader, 0, ("tilt",), (0.3,))
    for ms in range(10, 2000, 10):
        merged = read(reader, ms, ("pan_left", "pan_right"), (0.1, 0.2))
        assert merged == MergedJoints(BEGIN + ms * MS, (0.1, 0.2, 0.3))
    report = reader.report(1.99)
    assert (report.level, report.message) == (WARN, "joint_states no longer have tilt: the last angle is used")


def test_joint_states_that_stop_are_named() -> None:
    reader = JointStateReader()
    assert (reader.problem(9.0), reader.report(9.0).level) == ("no joint_states have arrived", WARN)
    read(reader, 0, JOINT_NAMES, (0.0, 0.0, 0.0))
    assert reader.problem(3.0) == "joint_states have stopped 3.0 s ago"
    assert reader.report(3.0).level == ERROR


@settings(max_examples=300, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(-(2**31) * 10**9, 2**31 * 10**9),
            st.lists(st.sampled_from([*JOINT_NAMES, "elbow", ""]) | st.text(max_size=5), max_size=5),
            st.lists(st.floats(), max_size=5),
            st.integers(0, 2**31 * 10**9),
        ),
        max_size=20,
    )
)
def test_whatever_arrives_only_finite_angles_with_rising_stamps_come_out(messages: list[Any]) -> None:
    reader, used = JointStateReader(), 0
    for i, (stamp_ns, names, positions, clock_ns) in enumerate(messages):
        merged = reader.read(stamp_ns, names, positions, clock_ns, 0.01 * i)
        used += merged is not None
        if merged is not None:
            assert all(math.isfinite(rad) and abs(rad) <= math.tau for rad in merged.angles_rad)
        assert len(reader.report(0.01 * i).message) < 300
    assert (reader.received, reader.merged) == (len(messages), used)
