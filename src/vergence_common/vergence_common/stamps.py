"""ROS stamps to integers and seconds, and back. Nanoseconds are exact; seconds are for control and display."""

from builtin_interfaces.msg import Time

_NS = 1_000_000_000


def to_nanoseconds(stamp: Time) -> int:
    """Return a stamp as integer nanoseconds since the epoch."""
    return int(stamp.sec) * _NS + int(stamp.nanosec)


def from_nanoseconds(nanoseconds: int) -> Time:
    """Return integer nanoseconds since the epoch as a stamp."""
    seconds, rest = divmod(int(nanoseconds), _NS)
    return Time(sec=seconds, nanosec=rest)


def to_seconds(stamp: Time) -> float:
    """Return a stamp in seconds; a float64 of the present epoch resolves 0.24 us."""
    return to_nanoseconds(stamp) * 1e-9


def to_stamp(seconds: float) -> Time:
    """Return seconds since the epoch as a stamp."""
    return from_nanoseconds(round(seconds * _NS))
