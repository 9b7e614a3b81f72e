"""What a tracker is asked to follow, and the pairs in which it may have been seen."""

from collections import deque
from dataclasses import dataclass

from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.eye_view import EyeView, Pixel, is_inside


@dataclass(frozen=True)
class TrackRequest:
    """A point (x, y) [px] of one eye's image taken at `stamp_s`, on behalf of a goal.

    For a tracker the pixel is one of the aligned images, from a node one of the images as they were taken. `extent_px`
    (width, height) is the size of the object there, None if unknown. `motion` asks for whatever moves next instead of
    the point. `goal_id` 0 ends a request: the tracker is free again to follow what lies at the fovea.
    """

    goal_id: int
    stamp_s: float
    left_eye: bool
    pixel: Pixel
    extent_px: tuple[float, float] | None = None
    motion: bool = False


@dataclass(frozen=True)
class StoredPair:
    """A pair of (h, w) grey images, the right one aligned, with both eyes' views at their exposures."""

    stamp_s: float
    left: Image
    right: Image
    views: tuple[EyeView, EyeView]


class RequestedPointError(ValueError):
    """A requested point of which nothing can be learnt: it lies outside the image."""


def check_inside(pixel: Pixel, image: Image, otherwise: str = "") -> None:
    """Raise RequestedPointError, which begins with `otherwise`, unless a pixel lies in an image (h, w)."""
    if not is_inside(pixel, image):
        (x_px, y_px), (height, width) = pixel, image.shape
        raise RequestedPointError(f"{otherwise}({x_px:.1f}, {y_px:.1f}) px must be in the {width}x{height} image")


class PairMemory:
    """The pairs of the last `keep_s`, so that a point is learnt in the very image in which it was asked for."""

    def __init__(self, keep_s: float) -> None:
        self._keep_s = keep_s
        self._pairs: deque[StoredPair] = deque()

    def add(self, pair: StoredPair) -> None:
        """Store a pair; one that is not later than the last clears what came before."""
        if self._pairs and pair.stamp_s <= self._pairs[-1].stamp_s:
            self._pairs.clear()
        self._pairs.append(pair)
        while self._pairs[0].stamp_s < pair.stamp_s - self._keep_s:
            self._pairs.popleft()

    def nearest(self, stamp_s: float, within_s: float) -> StoredPair | None:
        """Return the pair nearest to a stamp, None if none is within `within_s` of it."""
        pair = min(self._pairs, key=lambda one: abs(one.stamp_s - stamp_s), default=None)
        return pair if pair is not None and abs(pair.stamp_s - stamp_s) <= within_s else None
