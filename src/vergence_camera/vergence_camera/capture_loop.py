"""The capture thread: grabs, stamps and delivers frames, and reconnects after any fault."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from vergence_camera.capture_statistics import CaptureStatistics
from vergence_camera.errors import (
    CameraError,
    CorruptFrameError,
    ModeMismatchError,
    ReplayEndedError,
    StalledError,
)
from vergence_camera.frame import Frame, FrameSource, Mode
from vergence_camera.stamps import Stamp, Stamper

_SLICE_S = 0.1
_CORRUPT_LOGGED_EVERY_S = 5.0


@dataclass(frozen=True)
class RetryPolicy:
    """Limits of a frame's age and of a stall, and the waits between reconnects [s]."""

    stall_s: float = 1.0
    max_age_s: float = 0.25
    first_s: float = 0.2
    longest_s: float = 5.0
    stamp_offset_s: float = 0.0


class CaptureLoop:
    """Runs one source in a thread of its own until stopped.

    `deliver` gets every good frame, once, in the capture thread, right after the grab. `retry_policy` may be
    replaced at any time. `log` gets a line for every change of state, and whether it is a warning.
    """

    def __init__(
        self,
        source: FrameSource,
        deliver: Callable[[Frame, Stamp], None],
        stamper: Stamper,
        statistics: CaptureStatistics,
        *,
        retry_policy: RetryPolicy | None = None,
        log: Callable[[str, bool], None] = lambda text, warning: None,
        ended: Callable[[], None] = lambda: None,
    ) -> None:
        self.retry_policy = retry_policy or RetryPolicy()
        self._source, self._deliver, self._stamper, self._statistics = source, deliver, stamper, statistics
        self._log, self._ended = log, ended
        self._agreed: Mode | None = None
        self._open = self._delivered = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._last_fault = ""
        self._corrupt_logged_s = -_CORRUPT_LOGGED_EVERY_S

    def connect(self) -> Mode:
        """Open the source now, in the caller's thread; raise CameraError as `FrameSource.open` does."""
        try:
            self._connect()
        except CameraError as error:
            self._statistics.fault(error)
            raise
        assert self._agreed is not None
        return self._agreed

    def start(self) -> None:
        """Begin to capture; a source that is not connected yet is connected, with retries."""
        self._thread = threading.Thread(target=self._run, name="capture", daemon=True)
        self._thread.start()

    def stop(self, timeout_s: float = 5.0) -> bool:
        """End the thread and release the source; False if a driver still blocks after `timeout_s`."""
        self._stop.set()
        if self._thread is None:
            self._source.close()
            return True
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            retry_s = self.retry_policy.first_s
            while not self._stop.is_set():
                try:
                    if not self._open:
                        self._connect()
                    self._stream()
                except ReplayEndedError as end:
                    self._statistics.ended()
                    self._log(str(end), False)
                    self._ended()
                    return
                except Exception as error:
                    # Any error of a driver or decoder leads to a reconnect; only this eye's frames are lost.
                    fault = error if isinstance(error, CameraError) else CameraError(f"{type(error).__name__}: {error}")
                    if self._delivered:
                        retry_s, self._delivered = self.retry_policy.first_s, False
                    self._disconnect(fault)
                    self._stop.wait(retry_s)
                    retry_s = min(retry_s * 2.0, self.retry_policy.longest_s)
        finally:
            self._source.close()

    def _connect(self) -> None:
        mode = self._source.open()
        agreed = self._agreed
        if agreed is not None and _shape(mode) != _shape(agreed):
            self._source.close()
            raise ModeMismatchError(f"{self._source.identity}: reconnected as {mode}, it was {agreed} before")
        self._agreed, self._open, self._last_fault = mode, True, ""
        self._statistics.connected(mode)
        self._log(f"{self._source.identity}: streaming {mode}", False)

    def _stream(self) -> None:
        """Deliver frames until something fails."""
        last_good_s = time.monotonic()
        while not self._stop.is_set():
            try:
                frame = self._source.read(_SLICE_S)
            except CorruptFrameError as error:
                self._corrupt(error)
                frame = None
            now_s = time.monotonic()
            if frame is None:
                if now_s - last_good_s > self.retry_policy.stall_s:
                    raise StalledError(
                        f"{self._source.identity}: no whole frame for {now_s - last_good_s:.1f} s "
                        f"(at most {self.retry_policy.stall_s:g} s)"
                    )
                continue
            last_good_s, self._delivered = now_s, True
            self._forward(frame)

    def _forward(self, frame: Frame) -> None:
        self._statistics.received(frame.sequence, frame.skipped)
        stamp = self._stamper.stamp(frame, self.retry_policy.stamp_offset_s)
        if stamp.age_ns > self.retry_policy.max_age_s * 1e9:
            self._statistics.too_old()
            return
        self._deliver(frame, stamp)

    def _disconnect(self, fault: CameraError) -> None:
        self._open = False
        self._statistics.fault(fault)
        # A camera that stays unplugged gives the same reason at every attempt: it is logged once.
        if str(fault) != self._last_fault:
            self._last_fault = str(fault)
            self._log(str(fault), True)
        self._source.close()

    def _corrupt(self, error: CorruptFrameError) -> None:
        self._statistics.corrupt(error)
        now_s = time.monotonic()
        if now_s - self._corrupt_logged_s > _CORRUPT_LOGGED_EVERY_S:
            self._corrupt_logged_s = now_s
            self._log(str(error), True)


def _shape(mode: Mode) -> tuple[str, int, int]:
    return mode.pixel_format, mode.width_px, mode.height_px
