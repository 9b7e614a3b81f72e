"""Which of several objects is the target: the requested one, else by a policy, and why.

| policy | the target is |
|---|---|
| sticky | the one chosen before, until it is gone for a time or a nearer one has been there for a time |
| largest | the one whose box is largest |
| nearest | the one at the least distance |
| central | the one nearest to the middle of the images |
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vergence_metric.boxes.detections import Box
from vergence_metric.boxes.follow_parameters import STICKY, FollowParameters
from vergence_metric.boxes.object_tracks import ObjectTracks
from vergence_metric.boxes.seen_object import SeenObject

_OFF_CENTER_COST = 0.3  # of score, from the image's middle to its border


@dataclass(frozen=True)
class RequestedObject:
    """What is to be the target: an object of a class ("": any), or one by its id while it is seen (0: any)."""

    class_name: str = ""
    object_id: int = 0


@dataclass(frozen=True)
class Choice:
    """The target in one pair of images, None without one, and why it is that one."""

    target: SeenObject | None
    reason: str


class TargetChoice:
    """Chooses from pair to pair, and keeps which object was chosen.

    Args:
        parameters: policy, margin and times.
        tracks: of the objects; they know for how long one has not been seen.
        hidden_classes: classes that are chosen only if they are requested by name.
    """

    def __init__(
        self, parameters: FollowParameters, tracks: ObjectTracks, hidden_classes: frozenset[str] = frozenset()
    ) -> None:
        self.parameters, self._tracks, self._hidden = parameters, tracks, hidden_classes
        self._requested = RequestedObject()
        self._rival_id, self._rival_since_s = 0, math.nan
        self.target_id = 0
        """The object chosen last, 0 without one."""

    def request(self, requested: RequestedObject) -> None:
        """Choose as requested from the next pair on."""
        self._requested = requested

    def choose(self, objects: Sequence[SeenObject], stamp_s: float, image_size_px: tuple[int, int]) -> Choice:
        """Return the target among the objects of a pair (of images of this width and height)."""
        wanted, by_id = self._requested, {one.object_id: one for one in objects}
        if wanted.object_id and self._tracks.unseen_s(wanted.object_id, stamp_s) < math.inf:
            self._set(wanted.object_id)
            return self._one(by_id.get(wanted.object_id), stamp_s, f"object {wanted.object_id} is requested")
        candidates = [one for one in objects if self._is_wanted(one.class_name)]
        policy = self.parameters.policy
        if policy != STICKY:
            best = max(candidates, key=lambda one: _VALUES[policy](one, image_size_px), default=None)
            self._set(best.object_id if best else 0)
            return Choice(best, f"the {policy} of {_counted(candidates)}" if best else self._nothing())
        return self._sticky(candidates, by_id, stamp_s, image_size_px)

    def _sticky(
        self,
        candidates: Sequence[SeenObject],
        by_id: dict[int, SeenObject],
        stamp_s: float,
        image_size_px: tuple[int, int],
    ) -> Choice:
        held = by_id.get(self.target_id)
        if held is not None and self._is_wanted(held.class_name):
            return self._held_or_rival(held, candidates, stamp_s)
        if held is None and self._tracks.unseen_s(self.target_id, stamp_s) < math.inf:
            return self._one(None, stamp_s, "")
        best = _best_in_view(candidates, image_size_px)
        self._set(best.object_id if best else 0)
        return Choice(best, f"best in view of {_counted(candidates)}" if best else self._nothing())

    def _held_or_rival(self, held: SeenObject, candidates: Sequence[SeenObject], stamp_s: float) -> Choice:
        """Return the target as it was, or the rival that has been preferable for long enough."""
        p = self.parameters
        rivals = [o for o in candidates if o is not held and o.class_name == held.class_name]
        rival = max(rivals, key=lambda one: _advantage(one, held), default=None)
        if rival is None or _advantage(rival, held) < p.takeover_ratio:
            self._rival_id = 0
            others = f", beside {len(rivals)} more" if rivals else ""
            return Choice(held, f"object {held.object_id} is the target as before{others}")
        if rival.object_id != self._rival_id:
            self._rival_id, self._rival_since_s = rival.object_id, stamp_s
        preferable_s = stamp_s - self._rival_since_s
        nearer = f"object {rival.object_id} is {_advantage(rival, held):.1f} times nearer than object {held.object_id}"
        if preferable_s < p.takeover_after_s:
            return Choice(held, f"{nearer}, for {preferable_s:.1f} of {p.takeover_after_s:g} s")
        self._set(rival.object_id)
        return Choice(rival, f"{nearer}, for {preferable_s:.1f} s")

    def _one(self, target: SeenObject | None, stamp_s: float, reason: str) -> Choice:
        if target is not None:
            return Choice(target, reason)
        unseen_s = self._tracks.unseen_s(self.target_id, stamp_s)
        return Choice(None, f"object {self.target_id}, the target, has not been seen for {unseen_s:.1f} s")

    def _is_wanted(self, class_name: str) -> bool:
        wanted = self._requested.class_name
        return class_name == wanted if wanted else class_name not in self._hidden

    def _nothing(self) -> str:
        return f"no {self._requested.class_name or 'object'} is in view"

    def _set(self, object_id: int) -> None:
        if object_id != self.target_id:
            self.target_id, self._rival_id = object_id, 0


def _advantage(rival: SeenObject, held: SeenObject) -> float:
    """Return how many times nearer a rival is; where a distance is not known, how many times larger."""
    if math.isfinite(rival.distance_m) and math.isfinite(held.distance_m):
        return held.distance_m / rival.distance_m
    return rival.size_px / held.size_px


def _off_center(box: Box, image_size_px: tuple[int, int]) -> float:
    """Return how far a box is from the image's middle: 1 in a corner."""
    middle = (image_size_px[0] - 1) / 2, (image_size_px[1] - 1) / 2
    return math.dist(box.center_px, middle) / math.hypot(*middle)


def _largest_off_center(one: SeenObject, image_size_px: tuple[int, int]) -> float:
    return max(_off_center(box, image_size_px) for box in (one.boxes.left, one.boxes.right) if box is not None)


def _best_in_view(candidates: Sequence[SeenObject], image_size_px: tuple[int, int]) -> SeenObject | None:
    """Return the object with the best score less a cost of its distance from the middle; pairs come before boxes."""

    def value(one: SeenObject) -> tuple[bool, float]:
        boxes = [box for box in (one.boxes.left, one.boxes.right) if box is not None]
        score = min(box.score for box in boxes)
        return one.boxes.pair is not None, score - _OFF_CENTER_COST * _largest_off_center(one, image_size_px)

    return max(candidates, key=value, default=None)


def _counted(candidates: Sequence[SeenObject]) -> str:
    return "one object" if len(candidates) == 1 else f"{len(candidates)} objects"


_VALUES: dict[str, Callable[[SeenObject, tuple[int, int]], float]] = {
    "largest": lambda one, _: one.size_px,
    "nearest": lambda one, _: -one.distance_m if math.isfinite(one.distance_m) else -1e9 / one.size_px,
    "central": lambda one, image_size_px: -_largest_off_center(one, image_size_px),
}
