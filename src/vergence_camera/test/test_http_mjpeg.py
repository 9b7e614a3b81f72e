"""A network camera that stalls, cuts, corrupts and lies costs frames, never the stream."""

import base64
import socket
import time
from collections.abc import Callable
from typing import Any

import pytest

from vergence_camera.errors import (
    CameraError,
    CorruptFrameError,
    DisconnectedError,
    ModeMismatchError,
    PermissionDeniedError,
    UnsupportedError,
    WrongSizeError,
)
from vergence_camera.frame import Frame, ModeRequest
from vergence_camera.sources.http_client import shown_url
from vergence_camera.sources.http_mjpeg import HttpMjpegSource

Make = Callable[..., bytes]
Serve = Callable[[Callable[[Any], None]], Any]


def source_of(url: str, request: ModeRequest | None = None) -> HttpMjpegSource:
    return HttpMjpegSource(url, request or ModeRequest("MJPG"), open_timeout_s=60.0)


def next_frame(source: HttpMjpegSource, within_s: float = 60.0) -> Frame:
    until = time.monotonic() + within_s
    while time.monotonic() < until:
        frame = source.read(0.1)
        if frame is not None:
            return frame
    raise AssertionError("no frame came")


def next_frame_and_go(source: HttpMjpegSource, server: Any) -> Frame:
    frame = next_frame(source)
    server.go()
    return frame


def until_disconnected(source: HttpMjpegSource) -> tuple[list[object], str]:
    """Read until the stream breaks; return the data of all frames, and the reason."""
    received: list[object] = []
    while True:
        try:
            frame = source.read(0.1)
        except DisconnectedError as error:
            return received, str(error)
        if frame is not None:
            received.append(frame.data)


@pytest.mark.parametrize("length", [True, False])
def test_the_servers_bytes_arrive_untouched(http_server: Serve, make_jpeg: Make, length: bool) -> None:
    def script(to: Any) -> None:
        to.begin()
        for number in range(5):
            to.part(make_jpeg(number), length=length)
            if not length:
                to.send(b"--frame\r\n")  # only the next boundary ends a picture without a length
            to.turn()
        to.stall()

    server = http_server(script)
    source = source_of(server.url)
    before = time.monotonic_ns()
    assert str(source.open()) == "MJPG 640x480 at unknown rate"
    frames = [next_frame_and_go(source, server) for _ in range(5)]
    assert [frame.data for frame in frames] == [make_jpeg(number) for number in range(5)]
    assert [frame.sequence for frame in frames] == list(range(5))
    assert before < frames[0].time_ns < frames[-1].time_ns < time.monotonic_ns()
    source.close()
    source.close()


def test_a_chunked_body_in_slow_slices(http_server: Serve, make_jpeg: Make) -> None:
    def script(to: Any) -> None:
        to.send(b"HTTP/1.1 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=--b\r\n")
        to.send(b"Transfer-Encoding: chunked\r\n\r\n")
        body = b"".join(b"--b\r\n\r\n" + make_jpeg(number, 64, 48) + b"\r\n" for number in range(3)) + b"--b--"
        for begin in range(0, len(body), 997):
            part = body[begin : begin + 997]
            message = f"{len(part):x};note=1\r\n".encode() + part + b"\r\n"
            to.send(message[:5])
            time.sleep(0.002)
            to.send(message[5:])
        to.send(b"0\r\n\r\n")
        to.stall()

    source = source_of(http_server(script).url)
    source.open()
    received, reason = until_disconnected(source)
    assert "ended the stream" in reason
    # Small pictures may come two at a time: then only the newest is wanted.
    assert received[-1] == make_jpeg(2, 64, 48)
    assert set(received) <= {make_jpeg(number, 64, 48) for number in range(3)}
    source.close()


def test_of_frames_that_waited_only_the_newest_is_taken(http_server: Serve, make_jpeg: Make) -> None:
    def script(to: Any) -> None:
        to.begin()
        for number in range(6):
            to.part(make_jpeg(number, 64, 48))
        to.stall()

    server = http_server(script)
    source = source_of(server.url)
    source.open()
    assert server.sent.wait(60.0)
    frame = next_frame(source)
    assert frame.data == make_jpeg(5, 64, 48)
    assert (frame.sequence, frame.skipped) == (5, 5)


def test_a_stall_is_silence_not_an_error(http_server: Serve, make_jpeg: Make) -> None:
    def script(to: Any) -> None:
        to.begin()
        to.part(make_jpeg())
        to.send(b"--frame\r\nContent-Type: image/jpeg\r\n\r\n" + make_jpeg()[:500])
        to.stall()

    source = source_of(http_server(script).url)
    source.open()
    next_frame(source)
    assert source.read(0.05) is None
    assert source.read(0.05) is None
    source.close()


def test_a_cut_connection_is_said_after_what_came(http_server: Serve, make_jpeg: Make) -> None:
    def script(to: Any) -> None:
        to.begin()
        to.part(make_jpeg(1))
        to.part(make_jpeg(2))
        to.send(b"--frame\r\n\r\n" + make_jpeg(3)[:1000])

    source = source_of(http_server(script).url)
    source.open()
    received, reason = until_disconnected(source)
    assert received[-1] == make_jpeg(2)
    assert "closed the stream" in reason


@pytest.mark.parametrize(
    ("damage", "error"),
    [
        (lambda good, small: good[: len(good) // 2], CorruptFrameError),
        (lambda good, small: b"not a picture", CorruptFrameError),
        (lambda good, small: small, WrongSizeError),
    ],
    ids=["cut", "noise", "size"],
)
def test_a_damaged_frame_costs_only_itself(
    http_server: Serve, make_jpeg: Make, damage: Callable[[bytes, bytes], bytes], error: type[CameraError]
) -> None:
    def script(to: Any) -> None:
        to.begin()
        for data in (make_jpeg(0), damage(make_jpeg(1), make_jpeg(1, 64, 48)), make_jpeg(2)):
            to.part(data)
            to.turn()
        to.stall()

    server = http_server(script)
    source = source_of(server.url)
    source.open()
    assert next_frame_and_go(source, server).data == make_jpeg(0)
    with pytest.raises(error):
        next_frame(source)
    server.go()
    assert next_frame(source).data == make_jpeg(2)


def test_a_wrong_length_costs_one_frame_and_the_stream_is_found_again(http_server: Serve, make_jpeg: Make) -> None:
    def script(to: Any) -> None:
        to.begin()
        to.part(make_jpeg(0))
        to.turn()
        to.send(b"--frame\r\nContent-Length: 100\r\n\r\n" + make_jpeg(1) + b"\r\n")
        to.turn()
        for number in (2, 3):
            to.part(make_jpeg(number))
            to.turn()
        to.stall()

    server = http_server(script)
    source = source_of(server.url)
    source.open()
    assert next_frame_and_go(source, server).data == make_jpeg(0)
    with pytest.raises(CorruptFrameError):
        next_frame(source)
    server.go()
    assert next_frame_and_go(source, server).data == make_jpeg(2)
    assert next_frame(source).data == make_jpeg(3)


def test_size_mismatch_names_both(http_server: Serve, make_jpeg: Make) -> None:
    def script(to: Any) -> None:
        to.begin()
        to.part(make_jpeg())
        to.stall()

    with pytest.raises(ModeMismatchError, match=r"1280x720.*640x480"):
        source_of(http_server(script).url, ModeRequest("MJPG", 1280, 720)).open()


@pytest.mark.parametrize(
    ("answer", "error", "text"),
    [
        (b"HTTP/1.0 404 Not Found\r\n\r\n", DisconnectedError, "404"),
        (b"HTTP/1.0 401 Unauthorized\r\n\r\n", PermissionDeniedError, "user and password"),
        (b"HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n<html>", UnsupportedError, "text/html"),
        (b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace\r\n\r\n", UnsupportedError, "no boundary"),
        (b"SSH-2.0-OpenSSH_9.2\r\n\r\n", DisconnectedError, "does not speak HTTP"),
        (b"", DisconnectedError, "no HTTP header"),
    ],
)
def test_other_answers_are_explained(http_server: Serve, answer: bytes, error: type[CameraError], text: str) -> None:
    with pytest.raises(error, match=text):
        source_of(http_server(lambda to: to.send(answer)).url).open()


def test_a_server_that_says_nothing_is_given_up(http_server: Serve) -> None:
    server = http_server(lambda to: to.stall())
    source = HttpMjpegSource(server.url, ModeRequest(), open_timeout_s=0.2)
    with pytest.raises(DisconnectedError):
        source.open()


def test_nobody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    with pytest.raises(DisconnectedError, match="cannot be reached"):
        source_of(f"http://127.0.0.1:{port}/").open()


def test_redirects_and_passwords(http_server: Serve, make_jpeg: Make) -> None:
    def script(to: Any) -> None:
        to.begin()
        to.part(make_jpeg())
        to.stall()

    camera = http_server(script)
    secret = camera.url.replace("http://", "http://user:p%40ss@")
    first = http_server(lambda to: to.send(f"HTTP/1.0 302 Found\r\nLocation: {secret}\r\n\r\n".encode()))
    source = source_of(first.url)
    source.open()
    assert f"Basic {base64.b64encode(b'user:p@ss').decode()}" in camera.requests[0]
    assert "p%40ss" not in source_of(secret).identity


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("http://user:p%40ss@host:80/a@b", "http://host:80/a@b"),
        ("rtsp://me:secret@10.0.0.2", "rtsp://10.0.0.2"),
        ("http://host/stream?x=1", "http://host/stream?x=1"),
        ("http://h/v?usr=me&pwd=s3&res=hd", "http://h/v?usr=...&pwd=...&res=hd"),
    ],
)
def test_addresses_are_shown_without_their_secrets(url: str, shown: str) -> None:
    assert shown_url(url) == shown
