"""What the camera's tests share: pictures, recordings made here, an HTTP server that misbehaves, a machine's tree."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

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


@dataclass
class FakeMachine:
    """A sysfs and /dev of its own, with webcams in it."""

    root: Path
    devices: list[Path] = field(default_factory=list)

    @property
    def sys(self) -> Path:
        return self.root / "sys"

    @property
    def dev(self) -> Path:
        return self.root / "dev"

    def plug_in(
        self,
        number: int,
        *,
        name: str = "HD Webcam C525",
        serial: str = "",
        port: str = "1-1",
        controller: str = "0000:00:14.0",
        vendor: str = "046d",
        product: str = "0826",
        speed: str = "480",
        metadata_too: bool = True,
    ) -> Path:
        bus = port.partition("-")[0]
        usb = self.sys / "devices" / "pci0000:00" / controller / f"usb{bus}" / port
        interface = usb / f"{port}:1.0"
        for directory, file, text in (
            (usb, "idVendor", vendor),
            (usb, "idProduct", product),
            (usb, "speed", speed),
            *([(usb, "serial", serial)] if serial else []),
        ):
            directory.mkdir(parents=True, exist_ok=True)
            (directory / file).write_text(text + "\n")
        for index, offset in enumerate((0, 1) if metadata_too else (0,)):
            node = f"video{number + offset}"
            video = interface / "video4linux" / node
            video.mkdir(parents=True)
            (video / "name").write_text(f"{name}: {name}\n")
            (video / "index").write_text(f"{index}\n")
            (video / "device").symlink_to(interface, target_is_directory=True)
            entry = self.sys / "class" / "video4linux" / node
            entry.parent.mkdir(parents=True, exist_ok=True)
            entry.symlink_to(video, target_is_directory=True)
            self.dev.mkdir(parents=True, exist_ok=True)
            (self.dev / node).touch()
            words = f"{vendor}_{name.replace(' ', '_')}" + (f"_{serial}" if serial else "")
            for kind, link in (
                ("by-id", f"usb-{words}-video-index{index}"),
                ("by-path", f"pci-{controller}-usb-0:{port.partition('-')[2]}:1.0-video-index{index}"),
            ):
                place = self.dev / "v4l" / kind / link
                place.parent.mkdir(parents=True, exist_ok=True)
                # Twins without serials fight for one by-id name: the later one wins, as with udev.
                place.unlink(missing_ok=True)
                place.symlink_to(Path("..") / ".." / node)
        return self.dev / f"video{number}"

    def unplug(self, number: int) -> None:
        for node in (f"video{number}", f"video{number + 1}"):
            entry = self.sys / "class" / "video4linux" / node
            if entry.is_symlink():
                entry.unlink()
            (self.dev / node).unlink(missing_ok=True)
            for link in (self.dev / "v4l").glob("by-*/*"):
                if link.is_symlink() and link.readlink().name == node:
                    link.unlink()


@pytest.fixture
def machine(tmp_path: Path) -> FakeMachine:
    return FakeMachine(tmp_path / "machine")


class MjpegServer:
    """An HTTP camera on the loopback. `script(send)` writes the body of each connection; `send` takes bytes."""

    def __init__(self, script: Callable[["Connection"], None]) -> None:
        self.script = script
        self.connections = 0
        self.requests: list[str] = []
        self._socket = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}/stream"
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while not self._ended.is_set():
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
                self.script(Connection(client, self._ended))
            except OSError:
                return

    def close(self) -> None:
        self._ended.set()
        self._socket.close()


@dataclass
class Connection:
    """One client of the server."""

    socket: socket.socket
    ended: threading.Event

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def begin(self, content_type: str = "multipart/x-mixed-replace; boundary=frame", extra: str = "") -> None:
        self.send(f"HTTP/1.0 200 OK\r\nContent-Type: {content_type}\r\n{extra}\r\n".encode())

    def part(self, data: bytes, *, length: bool = True, boundary: str = "frame") -> None:
        stated = f"Content-Length: {len(data)}\r\n" if length else ""
        self.send(f"--{boundary}\r\nContent-Type: image/jpeg\r\n{stated}\r\n".encode() + data + b"\r\n")

    def stall(self, seconds: float = 30.0) -> None:
        self.ended.wait(seconds)

    def pause(self, seconds: float) -> None:
        time.sleep(seconds)


@pytest.fixture
def http_server() -> Iterator[Callable[[Callable[[Connection], None]], MjpegServer]]:
    servers: list[MjpegServer] = []

    def make(script: Callable[[Connection], None]) -> MjpegServer:
        servers.append(MjpegServer(script))
        return servers[-1]

    yield make
    for server in servers:
        server.close()
