"""The capture thread delivers each frame once and comes back from everything, in the same process."""

import queue
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from vergence_camera.capture_loop import CaptureLoop, RetryPolicy
from vergence_camera.capture_statistics import CaptureStatistics
from vergence_camera.errors import (
    CameraError,
    CorruptFrameError,
    ModeMismatchError,
    ReplayEndedError,
    UnpluggedError,
    UsbBandwidthError,
)
from vergence_camera.frame import Clock, Encoding, Frame, Mode
from vergence_camera.stamps import Stamp, Stamper

MODE = Mode("MJPG", 640, 480, 30.0)
# Where this machine pauses, that is neither a stall nor an old frame.
PATIENT = RetryPolicy(stall_s=60.0, max_age_s=60.0, first_s=0.005, longest_s=0.02)


class ScriptedSource:
    """Plays a list of what `open` and `read` do: frames are numbers, exceptions are raised, None is silence."""

    identity = "scripted"

    def __init__(self, *opens: Mode | Exception) -> None:
        self.opens, self.steps = list(opens or (MODE,)), queue.SimpleQueue[int | Exception | None]()
        self.opened = self.closed = 0

    def open(self) -> Mode:
        result = self.opens.pop(0) if len(self.opens) > 1 else self.opens[0]
        if isinstance(result, Exception):
            raise result
        self.opened += 1
        return result

    def read(self, timeout_s: float) -> Frame | None:
        try:
            step = self.steps.get(timeout=timeout_s / 5)
        except queue.Empty:
            return None
        if isinstance(step, Exception):
            raise step
        if step is None:
            return None
        return Frame(b"", Encoding.JPEG, 640, 480, Clock.MONOTONIC.now_ns(), Clock.MONOTONIC, step)

    def close(self) -> None:
        self.closed += 1

    def play(self, *steps: int | Exception | None) -> None:
        for step in steps:
            self.steps.put(step)


class Bench:
    """A loop around a scripted source, with what it delivered."""

    def __init__(self, source: ScriptedSource, retry_policy: RetryPolicy = PATIENT) -> None:
        self.source, self.health = source, CaptureStatistics()
        self.delivered = queue.SimpleQueue[int]()
        self.logged: list[tuple[str, bool]] = []
        self.over = threading.Event()
        self.loop = CaptureLoop(
            source,
            self.deliver,
            Stamper(Clock.WALL.now_ns),
            self.health,
            retry_policy=retry_policy,
            log=lambda text, warning: self.logged.append((text, warning)),
            ended=self.over.set,
        )

    def deliver(self, frame: Frame, stamp: Stamp) -> None:
        assert threading.current_thread().name == "capture"
        self.delivered.put(frame.sequence)

    def take(self, count: int) -> list[int]:
        return [self.delivered.get(timeout=60.0) for _ in range(count)]

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        until_s = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < until_s, f"never: {what}"
            time.sleep(0.002)


@pytest.fixture
def run() -> Iterator[Callable[..., Bench]]:
    benches: list[Bench] = []

    def make(*opens: Mode | Exception, retry_policy: RetryPolicy = PATIENT) -> Bench:
        benches.append(Bench(ScriptedSource(*opens), retry_policy))
        benches[-1].loop.start()
        return benches[-1]

    yield make
    for bench in benches:
        assert bench.loop.stop(timeout_s=60.0)


def test_frames_in_order_once(run: Callable[..., Bench]) -> None:
    bench = run()
    bench.source.play(0, 1, None, 2)
    assert bench.take(3) == [0, 1, 2]
    assert bench.delivered.empty()


@pytest.mark.parametrize(
    "fault",
    [UnpluggedError("gone"), CameraError("odd"), RuntimeError("a decoder's own"), OSError(5, "EIO")],
    ids=lambda fault: type(fault).__name__,
)
def test_comes_back_from_a_fault(run: Callable[..., Bench], fault: Exception) -> None:
    bench = run()
    bench.source.play(0, fault, 1, fault, 2)
    assert bench.take(3) == [0, 1, 2]
    state = bench.health.snapshot()
    assert (state.reconnects, sum(state.faults.values()), state.connected) == (2, 2, True)
    assert str(fault).split("] ")[-1] in state.last_fault


def test_tries_again_until_it_can_be_opened(run: Callable[..., Bench]) -> None:
    trouble = UsbBandwidthError("no bandwidth")
    bench = run(trouble, trouble, trouble, MODE)
    bench.source.play(7)
    assert bench.take(1) == [7]
    assert bench.health.snapshot().faults == {"usb_bandwidth": 3}
    assert [text for text, bad in bench.logged if bad] == ["no bandwidth"]


def test_a_stall_is_a_fault(run: Callable[..., Bench]) -> None:
    bench = run(retry_policy=replace(PATIENT, stall_s=0.05))
    bench.source.play(0)
    assert bench.take(1) == [0]
    bench.wait_until(lambda: bench.source.opened >= 2, "it is opened again")
    bench.source.play(1)
    assert bench.take(1) == [1]
    assert bench.health.snapshot().faults["stalled"] >= 1


def test_a_corrupt_frame_costs_only_itself(run: Callable[..., Bench]) -> None:
    bench = run()
    bench.source.play(0, CorruptFrameError("half"), 2)
    assert bench.take(2) == [0, 2]
    state = bench.health.snapshot()
    assert (state.corrupt, state.reconnects, state.dropped_by_driver) == (1, 0, 0)


def test_a_stream_of_nothing_but_corrupt_frames_is_reopened(run: Callable[..., Bench]) -> None:
    bench = run(retry_policy=replace(PATIENT, stall_s=0.05))
    stop = threading.Event()

    def corrupt_for_ever() -> None:
        while not stop.wait(0.004):
            bench.source.play(CorruptFrameError("half"))

    feeder = threading.Thread(target=corrupt_for_ever)
    feeder.start()
    bench.wait_until(lambda: bench.source.opened >= 2, "it is opened again")
    stop.set()
    feeder.join()


def test_another_size_after_a_reconnect_is_refused_until_it_is_right_again(run: Callable[..., Bench]) -> None:
    small = Mode("MJPG", 320, 240, 30.0)
    bench = run(MODE, small, small, MODE)
    bench.source.play(0, UnpluggedError("gone"), 1)
    assert bench.take(2) == [0, 1]
    state = bench.health.snapshot()
    assert state.faults["mode_mismatch"] == 2
    assert any("320x240" in text and "640x480" in text for text, _ in bench.logged)


def test_frames_older_than_asked_are_dropped(run: Callable[..., Bench]) -> None:
    bench = run(retry_policy=replace(PATIENT, stamp_offset_s=1.0, max_age_s=0.5))
    bench.source.play(0, 1)
    bench.wait_until(lambda: bench.health.snapshot().too_old == 2, "both are dropped")
    bench.loop.retry_policy = PATIENT
    bench.source.play(2)
    assert bench.take(1) == [2]


def test_a_recording_that_ends_ends_the_thread(run: Callable[..., Bench]) -> None:
    bench = run()
    bench.source.play(0, ReplayEndedError("played"))
    assert bench.over.wait(60.0)
    assert bench.loop.stop(timeout_s=60.0)
    assert bench.health.snapshot().ended
    assert bench.source.closed >= 1


def test_connecting_first_in_the_callers_thread() -> None:
    bench = Bench(ScriptedSource(ModeMismatchError("640 asked, 320 given"), MODE))
    with pytest.raises(ModeMismatchError):
        bench.loop.connect()
    assert bench.loop.connect() == MODE
    bench.loop.start()
    bench.source.play(4)
    assert bench.take(1) == [4]
    assert bench.source.opened == 1
    assert bench.loop.stop(timeout_s=60.0)


def test_a_stuck_driver_does_not_hold_up_the_end() -> None:
    class Stuck(ScriptedSource):
        def read(self, timeout_s: float) -> Frame | None:
            release.wait(60.0)
            return None

    release = threading.Event()
    bench = Bench(Stuck())
    bench.loop.start()
    assert not bench.loop.stop(timeout_s=0.1)
    release.set()
    assert bench.loop.stop(timeout_s=60.0)


def test_one_eyes_fault_leaves_the_other_alone(run: Callable[..., Bench]) -> None:
    broken, sound = run(UnpluggedError("gone")), run()
    for number in range(20):
        sound.source.play(number)
    assert sound.take(20) == list(range(20))
    assert not broken.health.snapshot().connected
