"""Pairing the frames of two cameras by their stamps.

A pair is a left and a right frame of which each is the other's nearest among the frames that no earlier pair has used,
at most the slop apart (inclusive). It is released as soon as no later frame can change that:

- equal stamps at once;
- else, because stamps of one camera only grow, the later frame of the two is the earlier one's nearest for good, and
  only the next frame of the earlier one's camera could be nearer to the later. If that frame is here it decides; if it
  cannot come soon enough, by the shortest recent interval of that camera, the pair is released at once; else it is
  waited for, up to a time limit in periods of the camera.

So two 30 Hz cameras up to nearly half a period apart pair without waiting. At half a period, within the cameras'
jitter, it is undecided which frame will be the nearer one: there the wait is inherent, until the earlier camera's next
frame is here, which takes half a period more; the time limit counts only where that frame is lost. While fewer than
four intervals of a camera are known, every pair of unequal stamps waits so, up to a period less the skew.

Each frame is queued once and removed once: O(1) amortised. Times are integer nanoseconds. For one thread; no lock, no
callbacks.
"""

from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

from vergence_metric.pairs.frame_interval import FrameInterval
from vergence_metric.pairs.pair_statistics import PairStatistics
from vergence_metric.pairs.parameters import PairingParameters

Frame = TypeVar("Frame")

LEFT, RIGHT = 0, 1

JUMP_NS = 1_000_000_000
"""A stamp this much before or after its predecessor is a jump of time or a restarted camera [ns]."""

_LATE_RUN = 3  # increasing stamps in a row, all behind the last one, after which the clock counts as set back
_UNKNOWN_PERIOD_NS = 100_000_000


@dataclass(frozen=True, slots=True)
class Pair(Generic[Frame]):
    """A left and a right frame with their stamps [ns]."""

    left: Frame
    right: Frame
    left_stamp_ns: int
    right_stamp_ns: int

    @property
    def skew_ns(self) -> int:
        """Right stamp less left stamp [ns]."""
        return self.right_stamp_ns - self.left_stamp_ns


class _Stream(Generic[Frame]):
    """One camera's queue of frames, and the state of its clock."""

    def __init__(self, side: int) -> None:
        self.side = side
        self.clear()

    def clear(self) -> None:
        self.pending: deque[tuple[int, int, Frame]] = deque()
        self.stamp_ns: int | None = None
        self.removed_ns: int | None = None
        self.late_run = 0
        self.late_stamp_ns = 0
        self.restart()

    def restart(self) -> None:
        self.interval = FrameInterval()
        self.arrived_ns: int | None = None
        self.arrival_interval_ns = 0

    def wait_ns(self) -> int:
        """Return one period in arrival time: longer than by the stamps if a recording is replayed slowly."""
        return max(self.interval.period_ns or _UNKNOWN_PERIOD_NS, self.arrival_interval_ns)


class StereoPairer(Generic[Frame]):
    """Pairs two streams; see the module's docstring. `statistics` counts what happened to every frame."""

    def __init__(self, parameters: PairingParameters) -> None:
        self.statistics = PairStatistics()
        self.deadline_ns: int | None = None
        """Time at which to call `expire`, on the clock of `now_ns`; None if no pair waits."""
        self._streams: tuple[_Stream[Frame], _Stream[Frame]] = (_Stream(LEFT), _Stream(RIGHT))
        self.set_parameters(parameters)

    def set_parameters(self, parameters: PairingParameters) -> None:
        """Use these from the next frame on."""
        self._slop_ns = round(parameters.slop_s * 1e9)
        self._wait_periods = parameters.wait_periods
        self._queue = parameters.queue

    def add(self, side: int, stamp_ns: int, frame: Frame, now_ns: int) -> list[Pair[Frame]]:
        """Add a frame and return the pairs that are now decided, none or more, in order.

        Args:
            side: LEFT or RIGHT.
            stamp_ns: when the frame was taken, on the clock that both cameras share.
            frame: any object; it is returned in the pair.
            now_ns: the present time on a steady clock, the same for `expire`.
        """
        stream = self._streams[side]
        self.statistics.received[side] += 1
        if stream.stamp_ns is not None:
            step_ns = stamp_ns - stream.stamp_ns
            if step_ns <= 0:
                if not self._is_set_back(stream, stamp_ns, step_ns):
                    self.statistics.late[side] += 1
                    return []
                self.reset()
            elif step_ns > JUMP_NS:
                stream.restart()
            else:
                stream.interval.add(step_ns)
                self._update_arrival_interval(stream, now_ns)
        stream.stamp_ns = stamp_ns
        stream.arrived_ns = now_ns
        stream.late_run = 0
        pending = stream.pending
        pending.append((stamp_ns, now_ns, frame))
        if len(pending) > self._queue:
            self._drop(stream, None)
        return self._release(now_ns)

    def expire(self, now_ns: int) -> list[Pair[Frame]]:
        """Return the pairs whose time limit is over at `now_ns`."""
        return self._release(now_ns)

    def reset(self) -> None:
        """Drop every frame and the cameras' intervals, after a jump of the stamps."""
        self.statistics.resets += 1
        for stream in self._streams:
            self.statistics.unmatched[stream.side] += len(stream.pending)
            stream.clear()
        self.deadline_ns = None

    @staticmethod
    def _is_set_back(stream: _Stream[Frame], stamp_ns: int, step_ns: int) -> bool:
        stream.late_run = stream.late_run + 1 if stream.late_run == 0 or stamp_ns > stream.late_stamp_ns else 1
        stream.late_stamp_ns = stamp_ns
        return -step_ns > JUMP_NS or stream.late_run >= _LATE_RUN

    @staticmethod
    def _update_arrival_interval(stream: _Stream[Frame], now_ns: int) -> None:
        if stream.arrived_ns is None:
            return
        passed_ns, mean_ns = now_ns - stream.arrived_ns, stream.arrival_interval_ns
        if mean_ns == 0:
            stream.arrival_interval_ns = passed_ns
        else:
            stream.arrival_interval_ns = mean_ns + (min(passed_ns, 4 * mean_ns) - mean_ns) // 16

    def _release(self, now_ns: int) -> list[Pair[Frame]]:
        released: list[Pair[Frame]] = []
        left, right = self._streams
        self.deadline_ns = None
        while left.pending and right.pending:
            if left.pending[0][0] <= right.pending[0][0]:
                early, late = left, right
            else:
                early, late = right, left
            early_ns, early_arrived_ns, _ = early.pending[0]
            late_ns, late_arrived_ns, _ = late.pending[0]
            skew_ns = late_ns - early_ns
            if skew_ns > self._slop_ns:
                self._drop(early, late)
                continue
            if skew_ns:
                if len(early.pending) > 1:
                    if abs(early.pending[1][0] - late_ns) < skew_ns:
                        self._drop(early, late)
                        continue
                elif early.interval.earliest_ns < 2 * skew_ns:
                    wait_ns = round(self._wait_periods * early.wait_ns())
                    deadline_ns = max(early_arrived_ns, late_arrived_ns) + wait_ns
                    if now_ns < deadline_ns:
                        self.deadline_ns = deadline_ns
                        break
            released.append(self._pop_pair())
        return released

    def _pop_pair(self) -> Pair[Frame]:
        left, right = self._streams
        left_ns, _, left_frame = left.pending.popleft()
        right_ns, _, right_frame = right.pending.popleft()
        left.removed_ns, right.removed_ns = left_ns, right_ns
        self.statistics.matched(right_ns - left_ns)
        return Pair(left_frame, right_frame, left_ns, right_ns)

    def _drop(self, stream: _Stream[Frame], other: _Stream[Frame] | None) -> None:
        """Drop a stream's oldest frame; nearest to it is the other stream's oldest frame, or the one removed before."""
        stamp_ns = stream.pending.popleft()[0]
        stream.removed_ns = stamp_ns
        skew_ns = None
        if other is not None:
            skew_ns = other.pending[0][0] - stamp_ns
            if other.removed_ns is not None:
                skew_ns = min(skew_ns, abs(stamp_ns - other.removed_ns))
        self.statistics.missed(stream.side, skew_ns)
