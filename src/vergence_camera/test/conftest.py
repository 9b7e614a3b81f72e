"""What the camera's tests share: pictures, recordings and their playing, an HTTP server that misbehaves, a machine."""

import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from vergence_camera.frame import Frame, ModeRequest
from vergence_camera.sources.recordings import open_recording
from vergence_camera.sources.replay import Replay
from vergence_camera.testing.fake_machine import FakeMachine

Pixels = npt.NDArray[np.uint8]


def textured(number: int, width_px: int = 640, height_px: int = 480) -> Pixels:
    """A smooth coloured pattern that moves by 8 px per frame."""
    y, x = np.mgrid[0:height_px, 0:width_px].astype(np.float32)
    x = x + 8 * number
    planes = (np.sin(x / 23), np.cos(y / 31), np.sin((x + y) / 47))
    return np.stack([127 + 120 * plane for plane in planes], axis=2).astype(np.uint8)


def jpeg(number: int = 0, width_px: int = 640, height_px: int = 480, quality: int = 80) -> bytes:
    done, data = cv2.imencode(".jpg", textured(number, width_px, height_px), [cv2.IMWRITE_JPEG_QUALITY, quality])
    assert done
    return bytes(data)


@pytest.fixture(scope="session")
def make_jpeg() -> Callable[..., bytes]:
    return jpeg


@pytest.fixture(scope="session")
def make_pixels() -> Callable[..., Pixels]:
    return textured


@pytest.fixture
def mjpeg_avi(tmp_path: Path) -> Path:
    """Motion JPEG in an AVI, written by OpenCV: 10 frames of 320x240 at 25 Hz."""
    path = tmp_path / "mjpeg.avi"
    writer = cv2.VideoWriter(str(path), cv2.CAP_OPENCV_MJPEG, cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (320, 240))
    assert writer.isOpened()
    for number in range(10):
        writer.write(textured(number, 320, 240))
    writer.release()
    return path


class FakeTime:
    """A clock that only sleeping moves."""

    def __init__(self) -> None:
        self.ns = 1_000_000_000

    def now_ns(self) -> int:
        return self.ns

    def sleep(self, seconds: float) -> None:
        self.ns += round(seconds * 1e9)


@pytest.fixture
def clock() -> FakeTime:
    return FakeTime()


@pytest.fixture
def replay(clock: FakeTime) -> Callable[..., Replay]:
    """A maker of recordings that play by `clock`."""

    def make(path: Path, request: ModeRequest | None = None, **options: Any) -> Replay:
        recording = open_recording(path)
        return Replay(recording, request or ModeRequest(), sleep=clock.sleep, now_ns=clock.now_ns, **options)

    return make


@pytest.fixture(scope="session")
def frames_of() -> Callable[[Replay, int], Iterator[Frame]]:
    """The next frames of a recording."""

    def take(source: Replay, count: int) -> Iterator[Frame]:
        while count:
            frame = source.read(0.1)
            if frame is not None:
                count -= 1
                yield frame

    return take


@pytest.fixture
def machine(tmp_path: Path) -> FakeMachine:
    return FakeMachine(tmp_path / "machine")


class MjpegServer:
    """An HTTP camera on the loopback. `script(to)` writes the body of each connection.

    Where the script says `to.turn()` it waits for the test's `go()`: what the test has seen so far came before.
    """

    def __init__(self, script: Callable[["Connection"], None]) -> None:
        self.script = script
        self.sent = threading.Event()
        """Set when a script has sent everything that it sends before a stall."""
        self.turns = threading.Semaphore(0)
        self.connections = 0
        self.requests: list[str] = []
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}/stream"
        self.ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while not self.ended.is_set():
            try:
                client, _ = self._socket.accept()
            except OSError:
                return
            self.connections += 1
            threading.Thread(target=self._answer, args=(client,), daemon=True).start()

    def _answer(self, client: socket.socket) -> None:
        with client:
            request = b""
            while b"\r\n\r\n" not in request:
                data = client.recv(4096)
                if not data:
                    return
                request += data
            self.requests.append(request.decode())
            try:
                self.script(Connection(client, self))
            except OSError:
                return

    def go(self) -> None:
        self.turns.release()

    def close(self) -> None:
        self.ended.set()
        self._socket.close()


@dataclass
class Connection:
    """One client of the server."""

    socket: socket.socket
    server: MjpegServer

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def begin(self, content_type: str = "multipart/x-mixed-replace; boundary=frame", extra: str = "") -> None:
        self.send(f"HTTP/1.0 200 OK\r\nContent-Type: {content_type}\r\n{extra}\r\n".encode())

    def part(self, data: bytes, *, length: bool = True, boundary: str = "frame") -> None:
        stated = f"Content-Length: {len(data)}\r\n" if length else ""
        self.send(f"--{boundary}\r\nContent-Type: image/jpeg\r\n{stated}\r\n".encode() + data + b"\r\n")

    def stall(self) -> None:
        self.server.sent.set()
        self.server.ended.wait(300.0)

    def turn(self) -> None:
        while not self.server.turns.acquire(timeout=0.1):
            if self.server.ended.is_set():
                raise ConnectionAbortedError


@pytest.fixture
def http_server() -> Iterator[Callable[[Callable[[Connection], None]], MjpegServer]]:
    servers: list[MjpegServer] = []

    def make(script: Callable[[Connection], None]) -> MjpegServer:
        servers.append(MjpegServer(script))
        return servers[-1]

    yield make
    for server in servers:
        server.close()
