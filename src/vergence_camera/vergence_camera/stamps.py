"""From a capture time on some clock of this machine to ROS time."""

from collections.abc import Callable
from typing import NamedTuple

from vergence_camera.frame import Clock, Frame

_STEADY_READING_NS = 100_000


class Stamp(NamedTuple):
    """A frame's ROS time in nanoseconds, and how old the frame was when it was stamped."""

    ros_ns: int
    age_ns: int


class Stamper:
    """Stamps frames in ROS time, strictly increasing.

    The conversion is made afresh for each frame: its age is read on the clock that its capture time came from, and
    taken from ROS time now. A wall clock that is stepped, or simulated time, is thereby followed at once.
    """

    def __init__(self, ros_now_ns: Callable[[], int]) -> None:
        self._ros_now_ns = ros_now_ns
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
        ros_ns, here_ns = self._read_both(frame.clock)
        age_ns = max(0, here_ns - frame.time_ns) + round(offset_s * 1e9)
        stamp_ns = ros_ns - age_ns
        if ros_ns < self._last_now_ns:
            self.clock_jumps += 1
        elif stamp_ns <= self._last_stamp_ns:
            self.pushed_forward += 1
            stamp_ns = self._last_stamp_ns + 1
        self._last_stamp_ns, self._last_now_ns = stamp_ns, ros_ns
        return Stamp(stamp_ns, age_ns)

    def _read_both(self, clock: Clock) -> tuple[int, int]:
        """Read ROS time and `clock` at one instant; a reading that was interrupted is made again."""
        best: tuple[int, int, int] | None = None
        for _ in range(3):
            before = clock.now_ns()
            ros_ns = self._ros_now_ns()
            after = clock.now_ns()
            if best is None or after - before < best[0]:
                best = (after - before, ros_ns, (before + after) // 2)
            if best[0] < _STEADY_READING_NS:
                break
        assert best is not None
        return best[1], best[2]
