"""Network streams that have to be decoded (RTSP, H.264 over HTTP, ...), by OpenCV's bundled ffmpeg."""

import time

import cv2
import numpy as np

from vergence_camera.errors import CameraError, DisconnectedError, ModeMismatchError, WrongSizeError
from vergence_camera.frame import Clock, Encoding, Frame, Mode, ModeRequest
from vergence_camera.sources.http_client import shown_url
from vergence_camera.sources.requested_mode import check_requested, mode_of, size_alone


class DecodedStreamSource:
    """A FrameSource for a URL that ffmpeg opens.

    ffmpeg gives no arrival time: a frame's capture time is when its decoding began. It blocks while it waits, at most
    for `stall_timeout_s`; a longer silence is a DisconnectedError.
    """

    def __init__(self, url: str, request: ModeRequest, *, open_timeout_s: float, stall_timeout_s: float) -> None:
        self._url, self._request = url, request
        self._open_timeout_s, self._stall_timeout_s = open_timeout_s, stall_timeout_s
        self._capture: cv2.VideoCapture | None = None
        self._mode = Mode("", 0, 0, 0.0)
        self._sequence = 0

    @property
    def identity(self) -> str:
        """See FrameSource."""
        return shown_url(self._url)

    def open(self) -> Mode:
        """See FrameSource."""
        self.close()
        limits = [
            *(cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, int(self._open_timeout_s * 1000)),
            *(cv2.CAP_PROP_READ_TIMEOUT_MSEC, int(self._stall_timeout_s * 1000)),
        ]
        capture = cv2.VideoCapture(self._url, cv2.CAP_FFMPEG, limits)
        if not capture.isOpened():
            capture.release()
            raise DisconnectedError(f"{self.identity}: cannot be opened within {self._open_timeout_s:g} s, or decoded")
        self._capture = capture
        self._mode = mode_of(capture)
        try:
            check_requested(size_alone(self._request), self._mode, self.identity, "stream")
        except ModeMismatchError:
            self.close()
            raise
        return self._mode

    def read(self, timeout_s: float) -> Frame | None:
        """See FrameSource. `timeout_s` cannot be kept: ffmpeg blocks until a frame or its own limit."""
        if self._capture is None:
            raise CameraError(f"{self.identity}: read before open")
        if not self._capture.grab():
            raise DisconnectedError(f"{self.identity}: the stream ended or stalled")
        time_ns = time.monotonic_ns()
        done, pixels = self._capture.retrieve()
        if not done:
            raise DisconnectedError(f"{self.identity}: a frame could not be decoded")
        data = np.asarray(pixels, dtype=np.uint8)
        height, width = data.shape[:2]
        if (width, height) != (self._mode.width_px, self._mode.height_px):
            raise WrongSizeError(f"{self.identity}: frame of {width}x{height}, the stream began as {self._mode}")
        sequence, self._sequence = self._sequence, self._sequence + 1
        return Frame(data, Encoding.BGR, width, height, time_ns, Clock.MONOTONIC, sequence)

    def close(self) -> None:
        """See FrameSource."""
        capture, self._capture = self._capture, None
        if capture is not None:
            capture.release()
