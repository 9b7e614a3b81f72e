"""From a capture time on a clock of this machine to ROS time."""

from collections.abc import Callable
from typing import NamedTuple

from vergence_camera.frame import Clock, Frame

_STEADY_READING_NS = 100_000


class Stamp(NamedTuple):
    """A frame's ROS time in nanoseconds, and how old the frame was when it was stamped."""

    ros_ns: int
    age_ns: int


class Stamper:
    """Stamps frames in ROS time, strictly increasing; `ros_now_ns` reads it and may be replaced at any time.

    The conversion is made for each frame: its age, read on the clock of its capture time, is subtracted from ROS time
    now. A step of the wall clock, or simulated time, is thereby followed at once.
    """

    def __init__(self, ros_now_ns: Callable[[], int]) -> None:
        self.ros_now_ns = ros_now_ns
        self._last_stamp_ns = self._last_now_ns = 0
        self.pushed_forward = 0
        self.clock_jumps = 0

    def stamp(self, frame: Frame, offset_s: float = 0.0) -> Stamp:
        """Return the stamp of a frame.

        Args:
            frame: its `time_ns` and `clock` are used.
            offset_s: measured time from the middle of the exposure to the frame's capture time; it is subtracted.

        Returns:
            A stamp later than every one before it, unless ROS time itself has jumped back. The age includes the
            offset.
        """
        now_ns = frame.clock.now_ns
        before, ros_ns, after = now_ns(), self.ros_now_ns(), now_ns()
        if after - before >= _STEADY_READING_NS:
            before, ros_ns, after = self._read_again(frame.clock, (before, ros_ns, after))
        here_ns = (before + after) // 2
        age_ns = max(0, here_ns - frame.time_ns) + int(offset_s * 1e9)
        stamp_ns = ros_ns - age_ns
        if ros_ns < self._last_now_ns:
            self.clock_jumps += 1
        elif stamp_ns <= self._last_stamp_ns:
            self.pushed_forward += 1
            stamp_ns = self._last_stamp_ns + 1
        self._last_stamp_ns, self._last_now_ns = stamp_ns, ros_ns
        return Stamp(stamp_ns, age_ns)

    def _read_again(self, clock: Clock, first: tuple[int, int, int]) -> tuple[int, int, int]:
        """Return the best of up to three readings of `clock`, ROS time and `clock`: the first was interrupted."""
        best = first
        for _ in range(2):
            again = clock.now_ns(), self.ros_now_ns(), clock.now_ns()
            best = min(best, again, key=lambda reading: reading[2] - reading[0])
            if best[2] - best[0] < _STEADY_READING_NS:
                break
        return best
