"""The capture thread: grab, stamp, hand over, and come back after any fault."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from vergence_camera.errors import (
    CameraError,
    CorruptFrameError,
    ModeMismatchError,
    ReplayEndedError,
    StalledError,
)
from vergence_camera.frame import Frame, FrameSource, Mode
from vergence_camera.health import Health
from vergence_camera.stamps import Stamp, Stamper

_SLICE_S = 0.1
_CORRUPT_SAID_EVERY_S = 5.0


@dataclass(frozen=True)
class Patience:
    """How long to wait for what, in seconds."""

    stall_s: float = 1.0
    max_age_s: float = 0.25
    first_retry_s: float = 0.2
    last_retry_s: float = 5.0
    stamp_offset_s: float = 0.0


class CaptureLoop:
    """Runs one source in a thread of its own until stopped.

    `deliver` gets every good frame, once, in the capture thread, right after the grab. `patience` may be replaced at
    any time. `say` gets a line for every change of state, and whether it is a bad one.
    """

    def __init__(
        self,
        source: FrameSource,
        deliver: Callable[[Frame, Stamp], None],
        stamper: Stamper,
        health: Health,
        *,
        patience: Patience | None = None,
        say: Callable[[str, bool], None] = lambda text, bad: None,
        ended: Callable[[], None] = lambda: None,
    ) -> None:
        self.patience = patience or Patience()
        self._source, self._deliver, self._stamper, self._health = source, deliver, stamper, health
        self._say, self._ended = say, ended
        self._agreed: Mode | None = None
        self._open = self._delivered = False
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._last_fault = ""
        self._said_corrupt_s = -_CORRUPT_SAID_EVERY_S

    def connect(self) -> Mode:
        """Open the source now, in the caller's thread; raise CameraError as `FrameSource.open` does."""
        try:
            self._connect()
        except CameraError as error:
            self._health.fault(error)
            raise
        assert self._agreed is not None
        return self._agreed

    def start(self) -> None:
        """Begin to capture; a source that is not connected yet is connected, with retries."""
        self._thread = threading.Thread(target=self._run, name="capture", daemon=True)
        self._thread.start()

    def stop(self, timeout_s: float = 5.0) -> bool:
        """End the thread and release the source; False if a blocking driver did not let go in time."""
        self._stop.set()
        if self._thread is None:
            self._source.close()
            return True
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            retry_s = self.patience.first_retry_s
            while not self._stop.is_set():
                try:
                    if not self._open:
                        self._connect()
                    self._stream()
                except ReplayEndedError as end:
                    self._health.ended()
                    self._say(str(end), False)
                    self._ended()
                    return
                except Exception as error:
                    # Whatever a driver or decoder throws, this eye comes back; only its own frames are missing.
                    fault = error if isinstance(error, CameraError) else CameraError(f"{type(error).__name__}: {error}")
                    if self._delivered:
                        retry_s, self._delivered = self.patience.first_retry_s, False
                    self._disconnect(fault)
                    self._stop.wait(retry_s)
                    retry_s = min(retry_s * 2.0, self.patience.last_retry_s)
        finally:
            self._source.close()

    def _connect(self) -> None:
        mode = self._source.open()
        agreed = self._agreed
        if agreed is not None and _shape(mode) != _shape(agreed):
            self._source.close()
            raise ModeMismatchError(f"{self._source.identity}: came back as {mode}, it was {agreed} before")
        self._agreed, self._open, self._last_fault = mode, True, ""
        self._health.connected(mode)
        self._say(f"{self._source.identity}: streaming {mode}", False)

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
                if now_s - last_good_s > self.patience.stall_s:
                    raise StalledError(
                        f"{self._source.identity}: no whole frame for {now_s - last_good_s:.1f} s (allowed are "
                        f"{self.patience.stall_s:g} s)"
                    )
                continue
            last_good_s, self._delivered = now_s, True
            self._pass_on(frame)

    def _pass_on(self, frame: Frame) -> None:
        self._health.received(frame.sequence, frame.skipped)
        stamp = self._stamper.stamp(frame, self.patience.stamp_offset_s)
        if stamp.age_ns > self.patience.max_age_s * 1e9:
            self._health.too_old()
            return
        self._deliver(frame, stamp)

    def _disconnect(self, fault: CameraError) -> None:
        self._open = False
        self._health.fault(fault)
        # A camera that stays away gives the same reason at every try: once is enough.
        if str(fault) != self._last_fault:
            self._last_fault = str(fault)
            self._say(str(fault), True)
        self._source.close()

    def _corrupt(self, error: CorruptFrameError) -> None:
        self._health.corrupt(error)
        now_s = time.monotonic()
        if now_s - self._said_corrupt_s > _CORRUPT_SAID_EVERY_S:
            self._said_corrupt_s = now_s
            self._say(str(error), True)


def _shape(mode: Mode) -> tuple[str, int, int]:
    return mode.pixel_format, mode.width_px, mode.height_px
