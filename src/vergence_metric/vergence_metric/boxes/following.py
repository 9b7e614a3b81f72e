"""Which of several objects is the target: the one it was, as long as it is seen; else the best one in view."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from vergence_metric.box_parameters import BoxMetricParameters
from vergence_metric.boxes.association import Association, BoxPair
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.pair_geometry import PairGeometry, Pixel

_OFF_CENTER_COST = 0.3  # of score, from the image's middle to its border


@dataclass(frozen=True)
class Choice:
    """The target in this pair of images: a pair, or the box of the one eye that sees it, or neither."""

    pair: BoxPair | None = None
    left: Box | None = None
    right: Box | None = None


@dataclass(frozen=True)
class _Seen:
    """Where the target was: its class, and its place in each eye, as a direction in rig_base where eyes are known."""

    class_id: int
    places: tuple[Pixel | None, Pixel | None]
    directions: tuple[np.ndarray | None, np.ndarray | None]
    stamp_s: float


class TargetMemory:
    """Remembers the target's directions, so that the eyes may turn under it."""

    def __init__(self, parameters: BoxMetricParameters) -> None:
        self.parameters = parameters
        self._seen: _Seen | None = None

    def choose(
        self, found: Association, stamp_s: float, image_size_px: tuple[int, int], geometry: PairGeometry | None
    ) -> Choice:
        """Return the target among what was found, and remember it."""
        expected = self._expected(stamp_s, geometry)
        if expected is None:
            choice = _best(found, image_size_px)
        else:
            choice = self._same(found, expected)
        self._remember(choice, stamp_s, geometry)
        return choice

    def confirms(self, pair: BoxPair, found: Association, stamp_s: float, geometry: PairGeometry | None) -> bool:
        """Tell whether where the target was in both eyes speaks for this pair against every other box of its class.

        To be asked before `choose`, which remembers anew.
        """
        expected = self._expected(stamp_s, geometry)
        if expected is None or expected[0] is None or expected[1] is None:
            return False
        sides: list[tuple[Box, Pixel, Iterable[Box]]] = [
            (pair.left, expected[0], [p.left for p in found.pairs] + list(found.left_only)),
            (pair.right, expected[1], [p.right for p in found.pairs] + list(found.right_only)),
        ]
        for own, place, all_boxes in sides:
            distance = math.dist(own.center_px, place)
            others = [math.dist(b.center_px, place) for b in all_boxes if b is not own and b.class_id == own.class_id]
            if distance > self.parameters.follow_gate_px or 2.0 * distance > min(others, default=math.inf):
                return False
        return True

    def _expected(self, stamp_s: float, geometry: PairGeometry | None) -> tuple[Pixel | None, Pixel | None] | None:
        seen = self._seen
        if seen is None or not 0.0 <= stamp_s - seen.stamp_s <= self.parameters.forget_s:
            return None
        places = []
        for eye, (place, direction) in enumerate(zip(seen.places, seen.directions, strict=True)):
            if geometry is not None and direction is not None:
                moved = geometry.pixel(eye == 0, direction)
                place = moved if math.isfinite(moved[0]) else None
            places.append(place)
        return places[0], places[1]

    def _same(self, found: Association, expected: tuple[Pixel | None, Pixel | None]) -> Choice:
        gate, class_id = self.parameters.follow_gate_px, self._seen.class_id if self._seen else -1

        def off(boxes: tuple[Box | None, Box | None]) -> float:
            distances = [
                math.dist(box.center_px, place)
                for box, place in zip(boxes, expected, strict=True)
                if box is not None and place is not None
            ]
            return float(np.mean(distances)) if distances else math.inf

        candidates = [(off((p.left, p.right)), Choice(pair=p)) for p in found.pairs if p.left.class_id == class_id]
        candidates += [(off((b, None)), Choice(left=b)) for b in found.left_only if b.class_id == class_id]
        candidates += [(off((None, b)), Choice(right=b)) for b in found.right_only if b.class_id == class_id]
        near = [candidate for candidate in candidates if candidate[0] <= gate]
        return min(near, key=lambda candidate: candidate[0])[1] if near else Choice()

    def _remember(self, choice: Choice, stamp_s: float, geometry: PairGeometry | None) -> None:
        left = choice.pair.left if choice.pair else choice.left
        right = choice.pair.right if choice.pair else choice.right
        shown = left or right
        if shown is None:
            if self._seen is not None and not 0.0 <= stamp_s - self._seen.stamp_s <= self.parameters.forget_s:
                self._seen = None
            return
        boxes = (left, right)
        places = tuple(None if box is None else box.center_px for box in boxes)
        directions = tuple(
            None if box is None or geometry is None else geometry.direction(eye == 0, box.center_px)
            for eye, box in enumerate(boxes)
        )
        self._seen = _Seen(shown.class_id, (places[0], places[1]), (directions[0], directions[1]), stamp_s)


def _best(found: Association, image_size_px: tuple[int, int]) -> Choice:
    """Return the object with the best score, one near the middle before one at the border, a pair before a box."""
    middle = (image_size_px[0] - 1) / 2, (image_size_px[1] - 1) / 2

    def worth(*boxes: Box) -> float:
        off = max(math.dist(box.center_px, middle) for box in boxes) / math.hypot(*middle)
        return min(box.score for box in boxes) - _OFF_CENTER_COST * off

    if found.pairs:
        return Choice(pair=max(found.pairs, key=lambda pair: worth(pair.left, pair.right)))
    single = [(worth(box), Choice(left=box)) for box in found.left_only]
    single += [(worth(box), Choice(right=box)) for box in found.right_only]
    return max(single, key=lambda item: item[0])[1] if single else Choice()
