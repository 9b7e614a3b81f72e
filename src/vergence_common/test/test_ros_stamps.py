"""Stamps are exact in nanoseconds and good to a microsecond in seconds."""

from hypothesis import given
from hypothesis import strategies as st

from vergence_common.stamps import from_nanoseconds, to_nanoseconds, to_seconds, to_stamp


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_nanoseconds_are_exact(nanoseconds):
    assert to_nanoseconds(from_nanoseconds(nanoseconds)) == nanoseconds


@given(st.floats(0, 4e9 / 2, allow_nan=False))
def test_seconds_are_good_to_a_microsecond(seconds):
    assert abs(to_seconds(to_stamp(seconds)) - seconds) < 1e-6
