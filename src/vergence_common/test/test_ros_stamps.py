"""Stamps are exact in nanoseconds and good to a microsecond in seconds."""

from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from vergence_common.stamps import from_nanoseconds, stamp_of_serialised, to_nanoseconds, to_seconds, to_stamp


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_nanoseconds_are_exact(nanoseconds):
    assert to_nanoseconds(from_nanoseconds(nanoseconds)) == nanoseconds


@given(st.floats(0, 4e9 / 2, allow_nan=False))
def test_seconds_are_good_to_a_microsecond(seconds):
    assert abs(to_seconds(to_stamp(seconds)) - seconds) < 1e-6


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_the_stamp_of_a_serialised_message(nanoseconds):
    assert stamp_of_serialised(serialize_message(Header(stamp=from_nanoseconds(nanoseconds)))) == nanoseconds
