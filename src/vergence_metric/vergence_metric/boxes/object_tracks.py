"""Identities of objects: each keeps its id from pair to pair, by its place, depth, size and looks."""

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vergence_metric.boxes.assignment import optimal_assignment
from vergence_metric.boxes.association import Association, Expected
from vergence_metric.boxes.follow_parameters import FollowParameters
from vergence_metric.boxes.pair_geometry import PairGeometry
from vergence_metric.boxes.patch_descriptor import Descriptor, descriptor_correlation
from vergence_metric.boxes.seen_object import ObjectBoxes, ObjectMeasures, SeenObject, measured, objects_of

Array = NDArray[np.float64]

# Standard deviations of the differences between what is expected of an object and what is seen of it.
_PARALLAX_SIGMA_RAD = 0.012  # two joints without feedback, and the boxes of both eyes
_SIZE_SIGMA = 0.25  # of the logarithm of the box's size: another object may hide a part
_LOOKS_SIGMA = 0.22  # of the descriptors' correlation from 1
_HIDDEN_LOOKS_SIGMA = 0.5  # of that of an object that another one hides in part
_GATE_SIGMAS = 3.0
_MOST_SQUARED = 9.0  # of place, depth and size each
_MAX_COST = 16.0  # of all together: above, the object is another one

_TENTATIVE_PAIRS = 5  # an object seen in fewer may be a mistake of detection or pairing:
_TENTATIVE_COST = 4.0  # others are likelier to be what is seen

_RATE_HOLD_S = 0.6  # time in which the speed of an object out of sight fades
_RATE_GAIN = 0.35
_LARGEST_GATE_GROWTH = 1.0
_SIZE_GAIN, _PARALLAX_GAIN, _LOOKS_GAIN = 0.3, 0.3, 0.2
_SAME_LOOKS = 0.5  # least correlation at which the looks are learnt
_SURE_LOOKS = 0.8  # least correlation at which an object is recognised far from its place
_FAR_GATE = 3.0  # how far, in gates


class _EyeTrack:
    """Where one eye saw an object: a unit direction (3,) in rig_base, or a pixel (2,) without joint angles."""

    def __init__(self, place: Array, stamp_s: float) -> None:
        self._place, self._rate, self._stamp_s = place, np.zeros_like(place), stamp_s

    def fits(self, geometry: PairGeometry | None) -> bool:
        """Return whether its places are of the kind that this geometry gives."""
        return len(self._place) == (2 if geometry is None else 3)

    def at(self, stamp_s: float) -> Array:
        """Return where the object should be, moving on at a speed that fades."""
        passed_s = stamp_s - self._stamp_s
        return self._place + self._rate * _RATE_HOLD_S * (1.0 - math.exp(-passed_s / _RATE_HOLD_S))

    def update(self, place: Array, stamp_s: float) -> None:
        """Update by where it is seen."""
        passed_s = stamp_s - self._stamp_s
        if passed_s > 0.0:
            faded = self._rate * math.exp(-passed_s / _RATE_HOLD_S)
            self._rate = faded + _RATE_GAIN * (place - self.at(stamp_s)) / passed_s
        self._place, self._stamp_s = place, stamp_s


class _ObjectTrack:
    """One object over time."""

    def __init__(self, object_id: int, class_id: int) -> None:
        self.object_id, self.class_id = object_id, class_id
        self.eyes: list[_EyeTrack | None] = [None, None]
        self.seen_s, self.pairs = -math.inf, 0
        self.parallax_rad = self.log_size = self.nearness_per_m = math.nan
        self.looks: Descriptor | None = None

    def pixels(self, stamp_s: float, geometry: PairGeometry | None) -> list[Array | None]:
        """Return where each eye should see it (2,) [px], None where that is unknown."""
        places: list[Array | None] = []
        for eye, track in enumerate(self.eyes):
            place = None
            if track is not None and track.fits(geometry):
                place = track.at(stamp_s)
                if geometry is not None:
                    place = np.array(geometry.pixel(eye == 0, place))
            places.append(None if place is None or not np.isfinite(place).all() else place)
        return places

    @staticmethod
    def off_px(boxes: ObjectBoxes, pixels: list[Array | None]) -> list[float | None]:
        """Return how far each eye's box is from where it should be; None where one of the two is not known."""
        return [
            None if place is None or box is None else float(np.hypot(*(place - box.center_px)))
            for place, box in zip(pixels, boxes.sure, strict=True)
        ]

    def update(self, seen: ObjectMeasures, stamp_s: float, geometry: PairGeometry | None, gate_px: float) -> None:
        """Update by what is seen of it; where one eye's box is in its place, the other's must be too to count."""
        off_px = self.off_px(seen.boxes, self.pixels(stamp_s, geometry))
        one_in_place = min((off for off in off_px if off is not None), default=math.inf) <= gate_px
        for eye, (box, off) in enumerate(zip(seen.boxes.sure, off_px, strict=True)):
            if box is None or (one_in_place and off is not None and off > gate_px):
                continue
            pixel = box.center_px
            place = np.array(pixel) if geometry is None else geometry.direction(eye == 0, pixel)
            track = self.eyes[eye]
            if track is None or not track.fits(geometry):
                self.eyes[eye] = _EyeTrack(place, stamp_s)
            else:
                track.update(place, stamp_s)
        self.seen_s, self.pairs = stamp_s, self.pairs + 1
        self.parallax_rad = _averaged(self.parallax_rad, seen.parallax_rad, _PARALLAX_GAIN)
        self.log_size = _averaged(self.log_size, seen.log_size, _SIZE_GAIN)
        if seen.point_m is not None:
            nearness = 1.0 / float(np.linalg.norm(seen.point_m))
            self.nearness_per_m = _averaged(self.nearness_per_m, nearness, _PARALLAX_GAIN)
        correlation = descriptor_correlation(self.looks, seen.looks)
        if seen.hidden:
            return
        if self.looks is None:
            self.looks = seen.looks
        elif correlation is not None and correlation > _SAME_LOOKS and seen.looks is not None:
            mixed = (1.0 - _LOOKS_GAIN) * self.looks + _LOOKS_GAIN * seen.looks
            self.looks = np.asarray(mixed / np.linalg.norm(mixed), np.float32)


class ObjectTracks:
    """Gives every object in view an id that stays its own, over gaps of up to `forget_after_s` too."""

    def __init__(self, parameters: FollowParameters) -> None:
        self.parameters = parameters
        self._ids = itertools.count(1)
        self._tracks: list[_ObjectTrack] = []
        self._stamp_s = -math.inf

    def update(
        self,
        found: Association,
        stamp_s: float,
        images: tuple[NDArray[Any], NDArray[Any]] | None = None,
        geometry: PairGeometry | None = None,
    ) -> list[SeenObject]:
        """Return the objects of a pair of images, each with its id; a stamp that goes back forgets all.

        Args:
            found: the boxes of both images, paired.
            stamp_s: of the left image.
            images: both, to compare what the boxes hold; None compares places and sizes only.
            geometry: of the pair, None without joint angles.

        """
        self._forget(stamp_s)
        boxes = objects_of(found)
        seen = [measured(one, boxes, images, geometry) for one in boxes]
        costs = np.full((len(self._tracks), len(seen)), math.inf)
        for i, track in enumerate(self._tracks):
            pixels = track.pixels(stamp_s, geometry)
            for j, one in enumerate(seen):
                costs[i, j] = self._cost(track, one, pixels, stamp_s)
        owner = {j: self._tracks[i] for i, j in _assignment(costs)}
        objects = []
        for j, one in enumerate(seen):
            track = owner.get(j) or self._new(one.boxes.shown.class_id)
            track.update(one, stamp_s, geometry, self.parameters.gate_px)
            objects.append(_object(track, one))
        return objects

    def expected(self, object_id: int, stamp_s: float, geometry: PairGeometry | None) -> Expected | None:
        """Return where an object should be now; None for one that is not known, or not seen for too long."""
        track = self._recent(object_id, stamp_s)
        if track is None:
            return None
        left, right = (None if p is None else (float(p[0]), float(p[1])) for p in track.pixels(stamp_s, geometry))
        return Expected(track.class_id, left, right, self.parameters.gate_px)

    def unseen_s(self, object_id: int, stamp_s: float) -> float:
        """Return for how long an object has not been seen; inf if it is forgotten."""
        track = self._recent(object_id, stamp_s)
        return math.inf if track is None else stamp_s - track.seen_s

    def _recent(self, object_id: int, stamp_s: float) -> _ObjectTrack | None:
        recent = (t for t in self._tracks if 0.0 <= stamp_s - t.seen_s <= self.parameters.forget_after_s)
        return next((track for track in recent if track.object_id == object_id), None)

    def _forget(self, stamp_s: float) -> None:
        if stamp_s < self._stamp_s:
            self._tracks = []
        self._stamp_s = stamp_s
        self._tracks = [t for t in self._tracks if stamp_s - t.seen_s <= self.parameters.forget_after_s]

    def _new(self, class_id: int) -> _ObjectTrack:
        self._tracks.append(_ObjectTrack(next(self._ids), class_id))
        return self._tracks[-1]

    def _cost(self, track: _ObjectTrack, seen: ObjectMeasures, pixels: list[Array | None], stamp_s: float) -> float:
        """Return the sum of squared deviations of what is seen from an object; inf where it cannot be that one."""
        if track.class_id != seen.boxes.shown.class_id:
            return math.inf
        off_px = [off for off in track.off_px(seen.boxes, pixels) if off is not None]
        # What is out of sight may move aside: its place is known the worse the longer it is.
        gate_px = self.parameters.gate_px * (1.0 + min(stamp_s - track.seen_s, _LARGEST_GATE_GROWTH))
        correlation = descriptor_correlation(track.looks, seen.looks)
        recognised = correlation is not None and correlation > _SURE_LOOKS
        # Of boxes that are no pair one may be in its place all the same: then its depth is wrong.
        least_px = min(off_px, default=math.inf)
        if least_px > gate_px * (_FAR_GATE if recognised else 1.0):
            return math.inf
        cost = _TENTATIVE_COST if track.pairs < _TENTATIVE_PAIRS else 0.0
        cost += _squared(least_px, gate_px / _GATE_SIGMAS)
        cost += _squared(track.parallax_rad - seen.parallax_rad, _PARALLAX_SIGMA_RAD)
        cost += _squared(track.log_size - seen.log_size, _SIZE_SIGMA)
        if correlation is not None:
            cost += ((1.0 - correlation) / (_HIDDEN_LOOKS_SIGMA if seen.hidden else _LOOKS_SIGMA)) ** 2
        return cost if cost <= _MAX_COST else math.inf


def _assignment(costs: Array) -> list[tuple[int, int]]:
    """Return the (row, column) pairs of the least sum, where each that is left alone costs half of _MAX_COST."""
    rows, columns = costs.shape
    alone = np.full((rows, rows), math.inf)
    alone[np.diag_indices(rows)] = 0.5 * _MAX_COST
    new = np.full((columns, columns), math.inf)
    new[np.diag_indices(columns)] = 0.5 * _MAX_COST
    whole = np.block([[costs, alone], [new, np.zeros((columns, rows))]])
    return [(i, j) for i, j in optimal_assignment(whole) if i < rows and j < columns]


def _object(track: _ObjectTrack, seen: ObjectMeasures) -> SeenObject:
    version_rad = tilt_rad = math.nan
    if seen.point_m is not None:
        x, y, z = (float(value) for value in seen.point_m)
        version_rad, tilt_rad = math.atan2(y, math.hypot(x, z)), math.atan2(-z, x)
    distance_m, size_px = 1.0 / track.nearness_per_m, _size_px(track, seen)
    return SeenObject(track.object_id, seen.boxes, version_rad, tilt_rad, distance_m, size_px)


def _size_px(track: _ObjectTrack, seen: ObjectMeasures) -> float:
    width, height = seen.boxes.shown.size_px
    return math.exp(track.log_size) if math.isfinite(track.log_size) else math.sqrt(max(width * height, 1.0))


def _averaged(before: float, now: float, gain: float) -> float:
    if not math.isfinite(now):
        return before
    return now if not math.isfinite(before) else before + gain * (now - before)


def _squared(difference: float, sigma: float) -> float:
    """Return the squared deviation, limited; 0 where one of the two is not known."""
    return min((difference / sigma) ** 2, _MOST_SQUARED) if math.isfinite(difference) else 0.0
