"""How a target is learnt and found again: the part in which trackers differ. The lock is `locking_tracker.py`'s."""

from typing import Any, Protocol

from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_metric.tracking.saccade_detector import EyeMotion
from vergence_metric.tracking.track import Track


class Follower(Protocol):
    """Learns targets and follows them; what a target is made of is its own affair."""

    def requested(self, track_id: int, request: TrackRequest, pair: StoredPair) -> Any:
        """Return the target of a request, as it is in the pair in which it was asked for."""
        ...

    def locked(self, track_id: int, pair: StoredPair) -> tuple[Any, Track] | str:
        """Return the target that lies at the left fovea with its track, or why there is none to lock on."""
        ...

    def follow(self, target: Any, pair: StoredPair, motion: EyeMotion) -> Track | str:
        """Return the track of a target in the next pair, or why it is given up."""
        ...
