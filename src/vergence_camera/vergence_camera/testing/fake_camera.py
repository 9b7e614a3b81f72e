"""A webcam that exists only in tests: its modes, buffers and faults."""

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping

from vergence_camera.testing.fake_controls import FakeControl, webcam_controls
from vergence_camera.v4l2 import structures as v4l2

Sizes = Mapping[str, Mapping[tuple[int, int], tuple[int, ...]]]
WEBCAM_SIZES: Sizes = {
    "MJPG": {(640, 480): (30, 15), (1280, 720): (30,), (320, 240): (30,)},
    "YUYV": {(640, 480): (30,), (1280, 720): (10,)},
}


class FakeCamera:
    """One webcam. `push` is a frame arriving from the sensor; the fields ending in `_errno` are faults to inject."""

    def __init__(
        self,
        card: str = "Fake HD Webcam",
        bus: str = "usb-0000:00:14.0-1",
        sizes: Sizes = WEBCAM_SIZES,
        controls: list[FakeControl] | None = None,
    ) -> None:
        self.card, self.bus, self.sizes = card, bus, sizes
        self.controls = {c.cid: c for c in (webcam_controls() if controls is None else controls)}
        self.capabilities = v4l2.CAP_VIDEO_CAPTURE | v4l2.CAP_STREAMING
        self.timestamp_flags = v4l2.TIMESTAMP_MONOTONIC
        self.open_errno = self.stream_errno = self.dequeue_errno = 0
        self.extended_query = True
        self.requests: list[int] = []
        code, by_size = next(iter(sizes.items()))
        (self.width, self.height), rates = next(iter(by_size.items()))
        self.code, self.rate = code, float(rates[0])
        self.plugged, self.streamer = True, 0
        self.sequence = 0
        self.memory: list[bytearray] = []
        self.queued: deque[int] = deque()
        self.filled: deque[v4l2.Buffer] = deque()
        self.changed = threading.Condition()

    def push(self, data: bytes, time_ns: int | None = None, *, damaged: bool = False) -> bool:
        """Deliver one frame; False if the stream is off or no buffer is free (the frame is dropped, but counted)."""
        with self.changed:
            sequence, self.sequence = self.sequence, self.sequence + 1
            if not self.streamer or not self.queued:
                return False
            index = self.queued.popleft()
            self.memory[index][: len(data)] = data
            monotonic = self.timestamp_flags & v4l2.TIMESTAMP_MASK == v4l2.TIMESTAMP_MONOTONIC
            stamp_us = (time_ns or (time.monotonic_ns() if monotonic else time.time_ns())) // 1000
            buffer = v4l2.Buffer(index=index, type=v4l2.CAPTURE, memory=v4l2.MMAP, bytesused=len(data))
            buffer.sequence = sequence
            buffer.flags = self.timestamp_flags | (v4l2.BUFFER_ERROR if damaged else 0)
            buffer.timestamp = v4l2.TimeValue(*divmod(stamp_us, 1_000_000))
            self.filled.append(buffer)
            self.changed.notify_all()
            return True

    def play(self, frames: Callable[[int], bytes], rate_hz: float) -> Callable[[], None]:
        """Push `frames(0), frames(1), ...` at a rate from a thread of its own; return what stops it.

        They are stamped, on the monotonic clock, with when they were due: a machine that pauses delays them only.
        """
        stop, begin_ns = threading.Event(), time.monotonic_ns()

        def run() -> None:
            for number in itertools.count():
                due_ns = begin_ns + round(number * 1e9 / rate_hz)
                if stop.wait(max(0.0, (due_ns - time.monotonic_ns()) * 1e-9)):
                    return
                self.push(frames(number), due_ns)

        thread = threading.Thread(target=run, name="fake camera", daemon=True)
        thread.start()

        def end() -> None:
            stop.set()
            thread.join()

        return end

    def unplug(self) -> None:
        """Pull the plug: open descriptors then fail with 'no such device'."""
        with self.changed:
            self.plugged, self.streamer = False, 0
            self.changed.notify_all()

    def plug_in(self) -> None:
        """Put the plug back: the camera has its power-on controls again."""
        with self.changed:
            self.plugged, self.sequence = True, 0
            for control in self.controls.values():
                control.value = control.default
