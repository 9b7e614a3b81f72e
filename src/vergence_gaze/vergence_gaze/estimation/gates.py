"""The gates between a sighting and the target's estimate: why one was refused is found here, on this page.

A sighting of each source passes its gates in the order of the table below; the first that refuses it gives the reason,
which `gaze/state` reports. What has passed all of them updates the filter, whose own gate is the last one: it refuses
what is farther from the predicted target than `target.gate_sigma` allows, until `target.jump_count` agree.

| gate | sources | refuses |
|---|---|---|
| RequestGate | all | what was not asked for: another goal's track, another class, a stream of points |
| MeasuredGate | all | what its estimator does not call measured |
| StillGate | track, box | exposures while the eyes turned |
| PointGate | track | of a point in space: what does not lie there |
| ClassGate | track, box | of a class: a track that no box has been around for `target.distractor_persistence_s` |
| JumpGate | track, box | what is at another place or depth, until it has been there for long enough |
| NewerGate | box | boxes of a pair that the tracker has already shown |
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from vergence_gaze.estimation.exposures import Exposures
from vergence_gaze.estimation.kalman import Measurement
from vergence_gaze.estimation.observations import SAME_PAIR_S, BoxSighting, PointSighting, TrackSighting
from vergence_gaze.estimation.target_estimate import TargetEstimate
from vergence_gaze.goals.requested_point import RequestedPoint
from vergence_gaze.target_parameters import TargetParameters

Array = npt.NDArray[np.float64]

_KEPT_PAIRS = 30  # a second of tracks, to compare with boxes that arrive later
_DEPTH_SIGMAS = 2.0  # of the estimated vergence that count as its noise: that of a manoeuvring target grows fast
_BOXES_IN_MEAN = 4  # boxes whose middle is averaged, as a fading mean


class Verdict(NamedTuple):
    """Whether a gate accepts a sighting, and why not, or why only its direction counts and not its depth."""

    accepted: bool
    reason: str = ""
    direction_only: bool = False


ACCEPTED = Verdict(True)


@dataclass(frozen=True)
class Sighting:
    """One observation of a possible target by a source ("track", "box" or "point"), and where it shows the target.

    `locate` returns the measurement for the filter and (left pan, right pan, tilt) (3,) [rad] of what was seen, NaN
    where it was not seen; it raises SightingError for what gives no direction.
    """

    source: str
    observation: TrackSighting | BoxSighting | PointSighting
    locate: Callable[[], tuple[Measurement, Array]]
    skew_s: float = 0.0
    extent_rad: float = 0.0

    @property
    def stamp_s(self) -> float:
        """Stamp of the left image."""
        return self.observation.stamp_s

    @cached_property
    def located(self) -> tuple[Measurement, Array]:
        """The measurement and the place (3,)."""
        return self.locate()

    @property
    def seen_rad(self) -> Array:
        """The place (3,): left pan, right pan, tilt."""
        return self.located[1]

    @property
    def vergence_rad(self) -> float:
        """The vergence that fixates it; NaN while one eye alone sees it."""
        return float(self.seen_rad[1] - self.seen_rad[0])

    @property
    def half_rad(self) -> float:
        """Half of its angular width; 0 if unknown."""
        return 0.5 * min(max(self.extent_rad, 0.0), 1.0) if math.isfinite(self.extent_rad) else 0.0

    @property
    def own_depth_rad(self) -> float:
        """By how much vergence may differ over an object that is as deep as wide."""
        return abs(self.vergence_rad) * 2.0 * self.half_rad if math.isfinite(self.vergence_rad) else 0.0


class Gate(Protocol):
    """One reason for which sightings are refused."""

    def check(self, sighting: Sighting, estimate: TargetEstimate | None) -> Verdict:
        """Return whether the sighting may be the target's, which is expected at `estimate` (None: nowhere yet)."""
        ...


class MeasuredGate:
    """Refuses what its own estimator does not call measured."""

    def check(self, sighting: Sighting, estimate: TargetEstimate | None) -> Verdict:
        """See Gate."""
        seen = sighting.observation
        if isinstance(seen, PointSighting) or seen.usable:
            return ACCEPTED
        return Verdict(False, seen.reason or f"the {sighting.source} shows no target")


class StillGate:
    """Refuses exposures while the eyes turned, unless they turned along with the target."""

    def __init__(self, exposures: Exposures) -> None:
        self._exposures = exposures

    def check(self, sighting: Sighting, estimate: TargetEstimate | None) -> Verdict:
        """See Gate."""
        still = self._exposures.were_still(sighting.stamp_s, sighting.skew_s, estimate)
        return ACCEPTED if still else Verdict(False, "the eyes were turning while the image was exposed")


@dataclass
class RequestGate:
    """Refuses what is not of the present request: a goal id of the tracker, a class ("": any), or a stream.

    Of a class, `object_id` is the one object that is meant; 0 for the one that the detector has chosen.
    """

    goal_id: int = 0
    class_name: str | None = None
    object_id: int = 0
    stream: bool = False

    def check(self, sighting: Sighting, estimate: TargetEstimate | None) -> Verdict:
        """See Gate. What was not asked for is refused without a reason."""
        seen = sighting.observation
        if isinstance(seen, PointSighting):
            return Verdict(self.stream)
        if isinstance(seen, BoxSighting):
            of_class = self.class_name is not None and self.class_name in ("", seen.class_name)
            return Verdict(of_class and self.object_id in (0, seen.object_id))
        if not self.goal_id:
            return Verdict(False)
        answers = seen.goal_id == self.goal_id
        return ACCEPTED if answers else Verdict(False, "the tracker has not found the requested target yet")


class PointGate:
    """Refuses what does not lie at a point that was requested in space."""

    def __init__(self, point: RequestedPoint) -> None:
        self._point = point

    def check(self, sighting: Sighting, estimate: TargetEstimate | None) -> Verdict:
        """See Gate."""
        objection = self._point.objection(sighting.seen_rad)
        return Verdict(False, f"nothing is seen at the requested point: {objection}") if objection else ACCEPTED


class ClassGate:
    """Refuses a track while no box of the requested class has been around what it follows for a time.

    Boxes are later than tracks; each is compared with the track of its own pair. `beside_rad` (2,) is how far their
    middle lies beside the track, in pan and tilt, averaged: a track may slip along its object.
    """

    def __init__(self, parameters: TargetParameters) -> None:
        self._p = parameters
        self.restart(-math.inf)

    def restart(self, stamp_s: float) -> None:
        """Accept what the tracker follows from now on: it was asked for what boxes have shown at `stamp_s`."""
        self._tracks: deque[Sighting] = deque(maxlen=_KEPT_PAIRS)
        self._confirmed_s = stamp_s
        self.beside_rad, self._compared = np.zeros(2), 0

    def check(self, sighting: Sighting, estimate: TargetEstimate | None) -> Verdict:
        """See Gate. Boxes are accepted, and confirm the track that they are around."""
        if sighting.source == "box":
            same = [track for track in self._tracks if abs(track.stamp_s - sighting.stamp_s) < SAME_PAIR_S]
            if same and _surrounds(sighting, same[-1], self._p):
                self._confirmed_s = max(self._confirmed_s, sighting.stamp_s)
                self._compared = min(self._compared + 1, _BOXES_IN_MEAN)
                beside_rad = (sighting.seen_rad - same[-1].seen_rad)[[0, 2]]
                self.beside_rad = self.beside_rad + (beside_rad - self.beside_rad) / self._compared
            return ACCEPTED
        self._tracks.append(sighting)
        if sighting.stamp_s - self._confirmed_s < self._p.distractor_persistence_s:
            return ACCEPTED
        return Verdict(False, "no box of the requested class is around what the tracker follows")


class JumpGate:
    """Refuses what is at another place or depth than the target until it has been measured there for long enough.

    Objects keep their depth. What is elsewhere at the target's depth is the target at once. At another depth it takes
    time if the target was moving, for then another object is likelier to pass; and longest while another source still
    shows the target where it was expected. Of a track, which is known by its looks, the direction counts even then.
    """

    def __init__(self, parameters: TargetParameters) -> None:
        self._p = parameters
        self._in_place_s: dict[str, float] = {}
        self._since_s: dict[str, float] = {}
        self._newest_s: dict[str, float] = {}

    def check(self, sighting: Sighting, estimate: TargetEstimate | None) -> Verdict:
        """See Gate."""
        if estimate is None:
            return ACCEPTED
        source, stamp_s = sighting.source, sighting.stamp_s
        aside, deeper = _is_aside(sighting, estimate, self._p), _is_deeper(sighting, estimate, self._p)
        if not (aside or deeper):
            self._in_place_s[source] = stamp_s
            self._since_s.pop(source, None)
            return ACCEPTED
        if stamp_s - self._newest_s.get(source, -math.inf) > self._p.jump_gap_s:
            self._since_s.pop(source, None)
        self._newest_s[source] = stamp_s
        since_s = self._since_s.setdefault(source, stamp_s)
        one_eye = math.isnan(sighting.vergence_rad)
        needed_s = self._needed_s(source, since_s, deeper or one_eye, estimate)
        if stamp_s - since_s >= needed_s:
            return ACCEPTED
        where = "beside" if aside else "at another depth than"
        reason = f"the {source} shows an object {where} the target, for less than {needed_s:g} s"
        return Verdict(source == "track" and not aside, reason, direction_only=True)

    def _needed_s(self, source: str, since_s: float, deeper: bool, estimate: TargetEstimate) -> float:
        others = (in_place_s for other, in_place_s in self._in_place_s.items() if other != source)
        if max(others, default=-math.inf) > since_s:
            return self._p.distractor_persistence_s
        return self._p.depth_moving_s if deeper and estimate.moving else 0.0


class NewerGate:
    """Refuses boxes of a pair that the tracker has already shown: it is more precise and earlier."""

    def __init__(self) -> None:
        self.tracked_s = -math.inf
        """Stamp of the newest track that updated the target."""

    def check(self, sighting: Sighting, estimate: TargetEstimate | None) -> Verdict:
        """See Gate."""
        if sighting.stamp_s > self.tracked_s:
            return ACCEPTED
        return Verdict(False, "the tracker has shown the target in this pair or a later one")


def _is_aside(sighting: Sighting, estimate: TargetEstimate, p: TargetParameters) -> bool:
    """Return whether a sighting's direction is beside the target by more than the object and the noise explain."""
    off_rad = np.abs(sighting.seen_rad - estimate.joints_rad)
    bound_rad = sighting.half_rad + p.same_place_rad + p.gate_sigma * estimate.joint_sigmas_rad
    return bool((off_rad > bound_rad)[[0, 2]].any() or (math.isnan(off_rad[0]) and off_rad[1] > bound_rad[1]))


def _is_deeper(sighting: Sighting, estimate: TargetEstimate, p: TargetParameters) -> bool:
    """Return whether a sighting's depth differs by more than the object's own depth and the noise explain."""
    off_rad = abs(sighting.vergence_rad - estimate.vergence_rad)
    return off_rad > p.same_depth_rad + sighting.own_depth_rad + _DEPTH_SIGMAS * float(estimate.sigmas_rad[1])


def _surrounds(box: Sighting, track: Sighting, p: TargetParameters) -> bool:
    """Return whether boxes are around what the tracker follows in the same pair, as deep as they are."""
    off_rad = np.abs(track.seen_rad - box.seen_rad)[[0, 2]]
    deeper_rad = abs(track.vergence_rad - box.vergence_rad)
    inside = float(off_rad.max()) <= box.half_rad + p.same_place_rad
    return inside and not deeper_rad > p.same_depth_rad + box.own_depth_rad
