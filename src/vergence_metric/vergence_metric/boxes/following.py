"""Which of several objects is the target: the same one as before while it is seen, else the best one in view."""

import math
from dataclasses import dataclass

import numpy as np

from vergence_metric.boxes.association import Association, BoxPair, Expected
from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.pair_geometry import PairGeometry, Pixel
from vergence_metric.boxes.parameters import FollowParameters

_OFF_CENTER_COST = 0.3  # of score, from the image's middle to its border


@dataclass(frozen=True)
class Choice:
    """The target in this pair of images: a pair, or the box of the one eye that sees it, or none."""

    pair: BoxPair | None = None
    left: Box | None = None
    right: Box | None = None


@dataclass(frozen=True)
class _Seen:
    """Where the target was: its class, its place in each image, and its direction in rig_base if angles are known."""

    class_id: int
    places: tuple[Pixel | None, Pixel | None]
    directions: tuple[np.ndarray | None, np.ndarray | None]
    stamp_s: float


class TargetMemory:
    """Keeps the target's last place as directions in rig_base, which turning eyes do not change."""

    def __init__(self, parameters: FollowParameters) -> None:
        self.parameters = parameters
        self._seen: _Seen | None = None

    def choose(
        self, found: Association, stamp_s: float, image_size_px: tuple[int, int], geometry: PairGeometry | None
    ) -> Choice:
        """Return the target among what was found, and remember it."""
        expected = self.expected(stamp_s, geometry)
        if expected is None:
            choice = _best(found, image_size_px)
        else:
            choice = self._same(found, expected)
        self._remember(choice, stamp_s, geometry)
        return choice

    def expected(self, stamp_s: float, geometry: PairGeometry | None) -> Expected | None:
        """Return where the target should be now if it rests in the world; None without a recent one."""
        seen = self._seen
        if seen is None or not 0.0 <= stamp_s - seen.stamp_s <= self.parameters.forget_after_s:
            return None
        places = []
        for eye, (place, direction) in enumerate(zip(seen.places, seen.directions, strict=True)):
            if geometry is not None and direction is not None:
                moved = geometry.pixel(eye == 0, direction)
                place = moved if math.isfinite(moved[0]) else None
            places.append(place)
        return Expected(seen.class_id, places[0], places[1], self.parameters.gate_px)

    def _same(self, found: Association, expected: Expected) -> Choice:
        gate, class_id = expected.gate_px, expected.class_id

        def off(boxes: tuple[Box | None, Box | None]) -> float:
            distances = [
                math.dist(box.center_px, place)
                for box, place in zip(boxes, (expected.left_px, expected.right_px), strict=True)
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
        if choice.pair is not None and choice.pair.ambiguous:
            right = None  # a guess must not decide the next pair
        shown = left or right
        if shown is None:
            if self._seen is not None and not 0.0 <= stamp_s - self._seen.stamp_s <= self.parameters.forget_after_s:
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
    """Return the object with the best score less a cost of its distance from the middle; pairs come before boxes."""
    middle = (image_size_px[0] - 1) / 2, (image_size_px[1] - 1) / 2

    def value(*boxes: Box) -> float:
        off = max(math.dist(box.center_px, middle) for box in boxes) / math.hypot(*middle)
        return min(box.score for box in boxes) - _OFF_CENTER_COST * off

    if found.pairs:
        return Choice(pair=max(found.pairs, key=lambda pair: value(pair.left, pair.right)))
    single = [(value(box), Choice(left=box)) for box in found.left_only]
    single += [(value(box), Choice(right=box)) for box in found.right_only]
    return max(single, key=lambda item: item[0])[1] if single else Choice()
