"""Two cameras, files or streams, with servos or without, as a body. Its time is the wall clock's: `advance` waits."""

import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TypeVar

import cv2
import numpy as np

from vergence.body import Array, BodyError, JointAngles, Picture
from vergence_camera.capture_loop import CaptureLoop
from vergence_camera.capture_statistics import CaptureStatistics
from vergence_camera.errors import CorruptFrameError
from vergence_camera.frame import Frame, FrameSource
from vergence_camera.pixels import decode
from vergence_camera.stamps import Stamp, Stamper
from vergence_metric.pairs.pairing import LEFT, RIGHT
from vergence_rig.camera import CameraModel
from vergence_rig.rig import JOINT_NAMES, Rig
from vergence_servo.command_guard import CommandRefusedError
from vergence_servo.servo_hardware import ServoHardware

Answer = TypeVar("Answer")

_KEPT = 8  # pictures of each eye that wait for the next step: what is older is of no use


class CameraBody:
    """Grabs both eyes' frames in threads of their own, and drives the servos in a third.

    Args:
        left: source of the left eye, not opened yet.
        right: that of the right one.
        rig: describes the head.
        servos: opened servos; None for eyes that stay as they are, which count as looking straight ahead.

    Raises:
        CameraError: a source that cannot be opened; everything is released then, the servos too.
    """

    cameras: tuple[CameraModel | None, CameraModel | None] = (None, None)

    def __init__(self, left: FrameSource, right: FrameSource, rig: Rig, servos: ServoHardware | None = None) -> None:
        self.rig, self.can_move = rig, servos is not None
        self._pictures: tuple[queue.Queue[Picture], queue.Queue[Picture]] = (queue.Queue(_KEPT), queue.Queue(_KEPT))
        self._ended = [False, False]
        self._statistics = (CaptureStatistics(), CaptureStatistics())
        self._servos = None if servos is None else ServoThread(servos)
        self._loops: list[CaptureLoop] = []
        self._next_s = time.time()
        try:
            for side, source in ((LEFT, left), (RIGHT, right)):
                deliver, ended = partial(self._deliver, side), partial(self._on_end, side)
                loop = CaptureLoop(source, deliver, Stamper(time.time_ns), self._statistics[side], ended=ended)
                self._loops.append(loop)
                loop.connect()
            for loop in self._loops:
                loop.start()
        except BaseException:
            self.close()
            raise

    @property
    def time_s(self) -> float:
        """The wall clock's time [s]."""
        return time.time()

    def advance(self, duration_s: float) -> list[Picture | JointAngles]:
        """See Body. Raises BodyError where a camera gives nothing any more, or a servo cannot be driven."""
        self._next_s = max(self._next_s + duration_s, time.time() - duration_s)
        time.sleep(max(self._next_s - time.time(), 0.0))
        now_ns = time.time_ns()
        angles = dict.fromkeys(JOINT_NAMES, 0.0) if self._servos is None else self._servos.positions_rad()
        arrived: list[Picture | JointAngles] = [JointAngles(now_ns, np.array([angles[name] for name in JOINT_NAMES]))]
        for pictures in self._pictures:
            with suppress(queue.Empty):
                while True:
                    arrived.append(pictures.get_nowait())
        if len(arrived) == 1:
            self._check_cameras()
        return arrived

    def command(self, joints_rad: Array) -> None:
        """See Body. Raises BodyError for a command that the servos refuse."""
        if self._servos is None:
            raise BodyError("a head without servos cannot be moved")
        self._servos.command(dict(zip(JOINT_NAMES, joints_rad.tolist(), strict=True)))

    def close(self) -> None:
        """See Body; the servos are parked and released."""
        for loop in self._loops:
            loop.stop()
        if self._servos is not None:
            self._servos.close()

    def _deliver(self, side: int, frame: Frame, stamp: Stamp) -> None:
        try:
            pixels, _ = decode(frame)
        except CorruptFrameError as error:
            self._statistics[side].corrupt(error)
            return
        if pixels.ndim == 2:
            pixels = np.asarray(cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR), np.uint8)
        pictures, picture = self._pictures[side], Picture(side, stamp.ros_ns, pixels)
        while True:
            with suppress(queue.Full):
                pictures.put_nowait(picture)
                return
            with suppress(queue.Empty):
                pictures.get_nowait()

    def _on_end(self, side: int) -> None:
        self._ended[side] = True

    def _check_cameras(self) -> None:
        if any(self._ended):
            raise BodyError("the recording has ended")
        for name, statistics in zip(("left", "right"), self._statistics, strict=True):
            state = statistics.snapshot()
            if not state.connected and state.last_fault:
                raise BodyError(f"the {name} camera gives no pictures: {state.last_fault}")


class ServoThread:
    """Steps the servos in a thread of its own, so that they are held, timed out and guarded while the program works."""

    def __init__(self, servos: ServoHardware, period_s: float = 0.01) -> None:
        self._servos, self._period_s = servos, period_s
        self._lock, self._stop = threading.Lock(), threading.Event()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="servos", daemon=True)
        self._thread.start()

    def positions_rad(self) -> dict[str, float]:
        """Return the modelled position of every joint [rad]. Raises BodyError after a failure of the thread."""
        return self._do(lambda: self._servos.head.positions_rad(time.monotonic()))

    def command(self, angles_rad: dict[str, float]) -> None:
        """Command joints by name [rad]. Raises BodyError."""
        try:
            self._do(lambda: self._servos.head.command(angles_rad, time.monotonic()))
        except CommandRefusedError as error:
            raise BodyError(f"the servos refuse the command: {error}") from error

    def close(self) -> None:
        """Park, remember the pose, release; idempotent."""
        if self._stop.is_set():
            return
        self._stop.set()
        self._thread.join(5.0)
        with self._lock:
            try:
                self._servos.park()
                with suppress(OSError):
                    self._servos.save_pose()
            finally:
                self._servos.close()

    def _do(self, act: Callable[[], Answer]) -> Answer:
        if self._failure is not None:
            raise BodyError(f"the servos cannot be driven: {self._failure}") from self._failure
        with self._lock:
            return act()

    def _run(self) -> None:
        while not self._stop.wait(self._period_s):
            try:
                with self._lock:
                    self._servos.step()
            except Exception as error:  # a driver's; the guardian releases the servos
                self._failure = error
                return
