"""Recordings played at a rate: what an AVI of JPEGs, a video file and an image folder have in common."""

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Protocol, TypeAlias

from vergence_camera.errors import CorruptFrameError, ReplayEndedError, TruncatedFileError, UnsupportedError
from vergence_camera.frame import Clock, Encoding, Frame, Mode, ModeRequest, Pixels
from vergence_camera.jpeg import inspect_jpeg
from vergence_camera.sources.requested_mode import check_requested, size_alone
from vergence_rig.picture_file import check_size
from vergence_rig.regular_file import FileError

# One recorded picture: JPEG bytes as they lie in the file, decoded pixels (BGR or grey), or why it cannot be used.
Picture: TypeAlias = bytes | Pixels | CorruptFrameError


class Recording(Protocol):
    """Pictures in order, from the beginning each time that `pictures` is called."""

    @property
    def identity(self) -> str:
        """What is played, in words."""
        ...

    def mode(self) -> Mode:
        """Look into the recording and return its mode, rate 0 where it has none; raise CameraError if unusable."""
        ...

    def pictures(self) -> Iterator[Picture]:
        """Yield every picture; raise TruncatedFileError at a broken end."""
        ...


class Replay:
    """A FrameSource that plays a recording in real time.

    A frame's capture time is when it was due, on the monotonic clock, so that replayed stamps are as even as the
    recording's. `rate_hz` replaces the recording's own rate (0 keeps it; without one it is `default_rate_hz`). When
    the process was held up for longer than `catch_up_s`, the schedule starts anew instead of racing after it. A JPEG
    that is not whole is a CorruptFrameError unless `must_be_whole` is False.
    """

    def __init__(
        self,
        recording: Recording,
        request: ModeRequest,
        *,
        rate_hz: float = 0.0,
        loop: bool = True,
        must_be_whole: bool = True,
        catch_up_s: float = 0.25,
        default_rate_hz: float = 30.0,
        sleep: Callable[[float], None] = time.sleep,
        now_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._recording, self._request, self._loop, self._must_be_whole = recording, request, loop, must_be_whole
        self._asked_rate_hz, self._default_rate_hz, self._catch_up_ns = rate_hz, default_rate_hz, int(catch_up_s * 1e9)
        self._sleep, self._now_ns = sleep, now_ns
        self._pictures: Iterator[Picture] | None = None
        self._mode = Mode("", 0, 0, 0.0)
        self._sequence = self._due_ns = self._period_ns = self._in_this_round = 0

    @property
    def identity(self) -> str:
        """See FrameSource."""
        return self._recording.identity

    def open(self) -> Mode:
        """See FrameSource. Size and format must be as requested; the rate is the recording's unless one was given."""
        self.close()
        found = self._recording.mode()
        try:
            check_size(found.width_px, found.height_px)
        except FileError as error:
            raise UnsupportedError(f"{self.identity} {error}") from error
        rate = self._asked_rate_hz or found.rate_hz or self._default_rate_hz
        self._mode = Mode(found.pixel_format, found.width_px, found.height_px, rate)
        check_requested(size_alone(self._request), self._mode, self.identity, "recording")
        self._pictures = self._recording.pictures()
        self._due_ns, self._period_ns = self._now_ns(), round(1e9 / rate)
        return self._mode

    def read(self, timeout_s: float) -> Frame | None:
        """See FrameSource; ReplayEndedError after the last frame if it is to be played once."""
        due_ns = self._due_ns
        wait_ns = due_ns - self._now_ns()
        if wait_ns > timeout_s * 1e9:
            self._sleep(timeout_s)
            return None
        if wait_ns > 0:
            self._sleep(wait_ns * 1e-9)
        now_ns = self._now_ns()
        if now_ns - due_ns > self._catch_up_ns:
            due_ns = now_ns
        self._due_ns = due_ns + self._period_ns
        picture = self._next()
        sequence, self._sequence = self._sequence, self._sequence + 1
        return self._frame(picture, due_ns, sequence)

    def close(self) -> None:
        """See FrameSource."""
        pictures, self._pictures = self._pictures, None
        if pictures is not None:
            with contextlib.suppress(AttributeError):
                pictures.close()  # type: ignore[attr-defined]

    def _next(self) -> Picture:
        if self._pictures is None:
            raise ReplayEndedError(f"{self.identity}: the recording has ended")
        try:
            picture = next(self._pictures)
        except (StopIteration, TruncatedFileError) as end:
            self._begin_again(end)
            if isinstance(end, TruncatedFileError):
                raise
            return self._next()
        self._in_this_round += 1
        return picture

    def _begin_again(self, end: Exception) -> None:
        played, self._in_this_round = self._in_this_round, 0
        self.close()
        if self._loop and played:
            self._pictures = self._recording.pictures()
        elif not played and not isinstance(end, TruncatedFileError):
            raise ReplayEndedError(f"{self.identity}: has no picture in it")

    def _frame(self, picture: Picture, time_ns: int, sequence: int) -> Frame:
        if isinstance(picture, CorruptFrameError):
            raise picture
        if isinstance(picture, bytes):
            info = inspect_jpeg(picture, must_be_whole=self._must_be_whole)
            width, height, encoding = info.width_px, info.height_px, Encoding.JPEG
        else:
            height, width = picture.shape[:2]
            encoding = Encoding.GREY if picture.ndim == 2 else Encoding.BGR
        if width != self._mode.width_px or height != self._mode.height_px:
            raise CorruptFrameError(
                f"{self.identity}: picture {sequence} is {width}x{height}, the recording began as {self._mode}"
            )
        return Frame(picture, encoding, width, height, time_ns, Clock.MONOTONIC, sequence)
