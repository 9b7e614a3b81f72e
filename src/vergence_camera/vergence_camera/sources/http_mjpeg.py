"""A camera on the network that sends its JPEGs over HTTP."""

import contextlib
import time

from vergence_camera.errors import CameraError, DisconnectedError, WrongSizeError
from vergence_camera.frame import Clock, Encoding, Frame, Mode, ModeRequest
from vergence_camera.jpeg import JpegInfo, inspect_jpeg
from vergence_camera.sources.http_client import HttpStream, shown_url
from vergence_camera.sources.multipart import MultipartParser, Part, boundary_of
from vergence_camera.sources.requested_mode import check_requested

_MOST_WAITING = 64  # pictures; a server without pace always has another one


class HttpMjpegSource:
    """A FrameSource for multipart JPEG over HTTP.

    A frame's capture time is when its first byte came. When several frames wait in the connection, because the reader
    or the network was slow, only the newest is returned.
    """

    def __init__(self, url: str, request: ModeRequest, *, open_timeout_s: float, must_be_whole: bool = True) -> None:
        self._url, self._request = url, request
        self._open_timeout_s, self._must_be_whole = open_timeout_s, must_be_whole
        self._stream: HttpStream | None = None
        self._parser = MultipartParser(b"")
        self._parts: list[Part] = []
        self._mode = Mode("", 0, 0, 0.0)
        self._sequence = 0

    @property
    def identity(self) -> str:
        """See FrameSource."""
        return shown_url(self._url)

    def open(self) -> Mode:
        """See FrameSource. The size is that of the first whole picture."""
        self.close()
        deadline = time.monotonic() + self._open_timeout_s
        try:
            self._stream = HttpStream(self._url, self._open_timeout_s)
            try:
                self._parser = MultipartParser(boundary_of(self._stream.headers.get("content-type", "")))
            except CameraError as error:
                raise type(error)(f"{self.identity}: {error}") from None
            first = self._first_picture(deadline)
            self._mode = Mode("MJPG", first.width_px, first.height_px, 0.0)
            check_requested(self._request, self._mode, self.identity, "stream")
        except BaseException:
            self.close()
            raise
        return self._mode

    def read(self, timeout_s: float) -> Frame | None:
        """See FrameSource."""
        if not self._parts:
            self._receive(timeout_s)
        with contextlib.suppress(DisconnectedError):  # the received pictures come first; the next read raises it again
            while 0 < len(self._parts) < _MOST_WAITING and self._receive(0.0):
                pass
        if not self._parts:
            return None
        skipped = len(self._parts) - 1
        part = self._parts[-1]
        self._parts.clear()
        sequence = self._sequence + skipped
        self._sequence = sequence + 1
        info = self._inspect(part)
        if (info.width_px, info.height_px) != (self._mode.width_px, self._mode.height_px):
            raise WrongSizeError(
                f"{self.identity}: frame of {info.width_px}x{info.height_px}, the stream began as {self._mode}"
            )
        return Frame(
            part.data, Encoding.JPEG, info.width_px, info.height_px, part.time_ns, Clock.MONOTONIC, sequence, skipped
        )

    def close(self) -> None:
        """See FrameSource."""
        stream, self._stream = self._stream, None
        if stream is not None:
            stream.close()
        self._parts.clear()

    def _receive(self, timeout_s: float) -> bool:
        """Read what the connection has; True if it had anything."""
        if self._stream is None:
            raise DisconnectedError(f"{self.identity}: read before open")
        try:
            data = self._stream.read(timeout_s)
        except DisconnectedError as error:
            raise DisconnectedError(f"{self.identity}: {error}") from error
        if data is None:
            return False
        self._parts += self._parser.feed(data, time.monotonic_ns())
        return True

    def _first_picture(self, deadline: float) -> JpegInfo:
        trouble = "no picture came"
        while time.monotonic() < deadline:
            self._receive(0.1)
            while self._parts:
                try:
                    return self._inspect(self._parts[0])
                except CameraError as error:
                    trouble = str(error)
                    self._parts.pop(0)
        raise DisconnectedError(f"{self.identity}: {trouble} within {self._open_timeout_s:g} s")

    def _inspect(self, part: Part) -> JpegInfo:
        return inspect_jpeg(part.data, must_be_whole=self._must_be_whole)
