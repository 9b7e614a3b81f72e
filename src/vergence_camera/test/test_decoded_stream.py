"""A stream that has to be decoded, from an HTTP server on the loopback by OpenCV's own ffmpeg."""

import functools
import threading
from collections.abc import Callable, Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from vergence_camera.errors import CameraError, DisconnectedError, ModeMismatchError
from vergence_camera.frame import Encoding, ModeRequest
from vergence_camera.sources.decoded_stream import DecodedStreamSource


class QuietHandler(SimpleHTTPRequestHandler):
    """Serves a folder and says nothing."""

    def log_message(self, format: str, *args: Any) -> None:
        pass


@pytest.fixture
def url(tmp_path: Path, make_pixels: Callable[..., np.ndarray]) -> Iterator[str]:
    writer = cv2.VideoWriter(
        str(tmp_path / "clip.mkv"), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"mp4v"), 20.0, (160, 96)
    )
    if not writer.isOpened():
        pytest.skip("this OpenCV cannot write MPEG-4")
    for number in range(8):
        writer.write(make_pixels(number, 160, 96))
    writer.release()
    server = ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(QuietHandler, directory=str(tmp_path)))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}/clip.mkv"
    server.shutdown()
    server.server_close()
    thread.join()


def source_of(url: str, request: ModeRequest) -> DecodedStreamSource:
    return DecodedStreamSource(url, request, open_timeout_s=60.0, stall_timeout_s=60.0)


def test_frames_are_decoded_and_the_end_is_said(url: str, make_pixels: Callable[..., np.ndarray]) -> None:
    source = source_of(url, ModeRequest("MJPG", 160, 96, 30.0))
    mode = source.open()
    assert (mode.width_px, mode.height_px, mode.rate_hz) == (160, 96, 20.0)
    frames = [source.read(0.1) for _ in range(8)]
    for number, frame in enumerate(frames):
        assert frame is not None
        assert (frame.encoding, frame.sequence) == (Encoding.BGR, number)
        assert np.abs(np.asarray(frame.data).astype(int) - make_pixels(number, 160, 96)).mean() < 12
    with pytest.raises(DisconnectedError, match="ended or stalled"):
        source.read(0.1)
    source.close()
    source.close()
    with pytest.raises(CameraError, match="before open"):
        source.read(0.1)


def test_size_mismatch_names_both(url: str) -> None:
    with pytest.raises(ModeMismatchError, match=r"640x480.*160x96"):
        source_of(url, ModeRequest("MJPG", 640, 480)).open()


def test_what_cannot_be_opened(url: str) -> None:
    with pytest.raises(DisconnectedError, match="cannot be opened"):
        source_of(url.replace("clip", "other"), ModeRequest()).open()
