"""ROS stamps to integers and seconds, and back. Nanoseconds are exact; seconds are for control and display."""

import struct

from builtin_interfaces.msg import Time

STAMP_END = 12
"""Bytes of the encapsulation (4) and of the header's stamp (8), with which a CDR message begins."""

_NS = 1_000_000_000
_STAMP = struct.Struct("<iI"), struct.Struct(">iI")


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


def restamped(message: bytes, stamp_ns: int) -> bytes:
    """Return a serialised message that begins with a std_msgs/Header with another stamp [ns]."""
    return message[:4] + _STAMP[message[1] == 0].pack(*divmod(stamp_ns, _NS)) + message[STAMP_END:]


def stamp_of_serialised(message: bytes) -> int:
    """Return the stamp [ns] of a serialised message that begins with a std_msgs/Header.

    CDR: four bytes, of which the second is the order of bytes (0: big endian), then seconds and nanoseconds.
    """
    seconds, nanoseconds = _STAMP[message[1] == 0].unpack_from(message, 4)
    return int(seconds) * _NS + int(nanoseconds)
