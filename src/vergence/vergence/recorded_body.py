"""A recording as a body: its pictures and joint angles arrive as they did; it cannot be moved."""

from pathlib import Path

from vergence.bags.reader import HeadBag
from vergence.body import Array, BodyError, JointAngles, Picture
from vergence_metric.tracking.request import TrackRequest
from vergence_rig.rig import Rig


class RecordedBody:
    """A bag of a head.

    Args:
        path: the bag's folder.
        rig: describes the head that was recorded.
        namespace: of the head in the bag; None for the only one that there is.
    """

    can_move = False

    def __init__(self, path: str | Path, rig: Rig, namespace: str | None = None) -> None:
        self.rig, self.bag = rig, HeadBag(path, namespace)
        self.cameras = self.bag.cameras()
        self.time_s = self.bag.begin_ns * 1e-9
        self._events = self.bag.events()
        self._next = next(self._events, None)

    @property
    def ended(self) -> bool:
        """True once everything in the recording has arrived."""
        return self._next is None

    def advance(self, duration_s: float) -> list[Picture | JointAngles]:
        """See Body. Raises BodyError after the end of the recording."""
        if self._next is None:
            raise BodyError(f"the recording '{self.bag.path}' has ended")
        self.time_s += duration_s
        arrived: list[Picture | JointAngles] = []
        while self._next is not None and self._next[0] * 1e-9 <= self.time_s:
            if not isinstance(self._next[1], TrackRequest):
                arrived.append(self._next[1])
            self._next = next(self._events, None)
        return arrived

    def command(self, joints_rad: Array) -> None:
        """See Body; what was recorded cannot be moved."""
        raise BodyError("a recorded head cannot be moved")

    def close(self) -> None:
        """See Body."""
        self.bag.close()
