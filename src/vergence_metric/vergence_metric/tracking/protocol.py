"""What a tracker is."""

from collections.abc import Iterable
from typing import Protocol

from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.request import StoredPair, TrackRequest
from vergence_metric.tracking.saccade_detector import StampedEyeAngles
from vergence_metric.tracking.track import Track
from vergence_rig.geometry import EyeAngles


class Tracker(Protocol):
    """Follows one target from pair to pair.

    Built as `build(parameters, estimator, camera, kinematics)`, anew whenever one of these changes. `camera` is the
    ideal one that took both eyes' images (see `vergence_rig.eye_image`).
    """

    def update(
        self, left: Image, right: Image, stamp_s: float, eyes: EyeAngles, samples: Iterable[StampedEyeAngles] = ()
    ) -> Track:
        """Return where the target is in a pair; see `locking_tracker.LockingTracker.update`."""
        ...

    def lock_here(self) -> None:
        """Be free of any request: follow what lies at the fovea once the eyes rest."""
        ...

    def request(self, request: TrackRequest, pair: StoredPair) -> None:
        """Follow the requested point from now on; `pair` is the one in which it was seen."""
        ...
