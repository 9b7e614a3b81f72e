"""The parser of multipart bodies, as cameras write them."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vergence_camera.sources.multipart import MultipartParser, boundary_of

Make = Callable[..., bytes]


@pytest.mark.parametrize(
    ("content_type", "boundary"),
    [
        ("multipart/x-mixed-replace; boundary=frame", b"--frame"),
        ('multipart/x-mixed-replace;boundary="a b"', b"--a b"),
        ("Multipart/X-Mixed-Replace; charset=x; Boundary=--myboundary", b"--myboundary"),
    ],
)
def test_boundaries_as_cameras_write_them(content_type: str, boundary: bytes) -> None:
    assert boundary_of(content_type) == boundary


@settings(deadline=None, max_examples=80)
@given(st.lists(st.integers(1, 4000), min_size=1, max_size=60), st.booleans())
def test_the_parser_does_not_care_how_the_bytes_are_sliced(make_jpeg: Make, slices: list[int], length: bool) -> None:
    pictures = [make_jpeg(number, 48, 32) for number in range(4)]
    stated = [f"Content-Length: {len(p)}\r\n".encode() if length else b"" for p in pictures]
    stream = b"rubbish\r\n" + b"".join(
        b"--b\r\nContent-Type: image/jpeg\r\n" + text + b"\r\n" + picture + b"\r\n"
        for text, picture in zip(stated, pictures, strict=True)
    )
    parser = MultipartParser(b"--b")
    parts, position, now_ns = [], 0, 0
    while position < len(stream):
        size = slices[now_ns % len(slices)]
        now_ns += 1
        parts += parser.feed(stream[position : position + size], now_ns)
        position += size
    assert [part.data for part in parts] == pictures
    times = [part.time_ns for part in parts]
    assert times == sorted(times)
    assert times[0] > 0


def test_a_length_of_thousands_of_digits_is_no_length(make_jpeg: Callable[..., bytes]) -> None:
    picture = make_jpeg(0, 64, 48)
    parser = MultipartParser(b"--frame")
    head = b"--frame\r\nContent-Length: " + b"9" * 5000 + b"\r\n\r\n"
    assert [part.data for part in parser.feed(head + picture + b"\r\n--frame\r\n", 1)] == [picture]
