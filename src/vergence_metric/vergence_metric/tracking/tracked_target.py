"""The target that the tracker holds: where it should be next, and at which disparity, however the eyes turn."""

import itertools
import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from vergence_metric.tracking.appearance import Appearance
from vergence_metric.tracking.saccade_detector import EyeView, Pixel

_MOTION_MEMORY = 0.6  # share of the old angular velocity kept at each frame
_COAST_HALF_LIFE_S = 0.7  # a hidden target's predicted velocity fades: it may have stopped
_COAST_FROM_S = 0.3  # a hidden target goes on as it went over this time, not as its last two sightings had it
_SLOPE_OVER_S = 0.06


@dataclass
class Target:
    """What is known of the locked target, in directions of rig_base, so that turning eyes change nothing."""

    track_id: int
    lock_stamp_s: float
    looks: Appearance
    seen_s: float
    direction: np.ndarray  # unit vector in rig_base when last seen
    velocity: np.ndarray  # of that vector, per second
    bounded: bool  # its region was told from what is around
    aside_px: Pixel = (0.0, 0.0)  # of its region's centre, when locked on: where the eye looked
    hidden: bool = False
    right_seen_s: float = -math.inf
    absolute_rad: float = math.nan  # angle by which the right ray is turned against the left one, across
    sightings: deque[tuple[float, np.ndarray]] = field(default_factory=deque)  # of late: stamp and direction

    def predicted(self, stamp_s: float) -> np.ndarray:
        """Return the direction (3,) in which it should be seen now."""
        elapsed = stamp_s - self.seen_s
        rate = math.log(2.0) / _COAST_HALF_LIFE_S
        if self.hidden:
            direction = self.direction + self._steady_velocity() * (1.0 - math.exp(-rate * elapsed)) / rate
        else:
            direction = self.direction + self.velocity * elapsed
        return np.asarray(direction / np.linalg.norm(direction))

    def moved(self, stamp_s: float, direction: np.ndarray) -> None:
        """Take where it is seen now."""
        elapsed = stamp_s - self.seen_s
        if self.hidden:
            self.sightings.clear()
            self.velocity = np.zeros(3)
        elif elapsed > 0.0:
            self.velocity = self.velocity + (1.0 - _MOTION_MEMORY) * (
                (direction - self.direction) / elapsed - self.velocity
            )
        self.direction, self.seen_s, self.hidden = direction, stamp_s, False
        self.sightings.append((stamp_s, direction))
        while self.sightings[0][0] < stamp_s - _COAST_FROM_S:
            self.sightings.popleft()

    def _steady_velocity(self) -> np.ndarray:
        """Return its velocity over the last sightings (3,), whatever single ones say (Theil and Sen's median slope).

        Eyes that turn fast are not quite where their joints say, and what hides a target pulls at it first.
        """
        pairs = itertools.combinations(self.sightings, 2)
        slopes = [(b - a) / (t - s) for (s, a), (t, b) in pairs if t - s >= _SLOPE_OVER_S]
        return np.median(slopes, axis=0) if slopes else np.zeros(3)

    def looked_at(self, center_px: Pixel) -> Pixel:
        """Return the pixel of the point that the eye looked at when it locked on, for a centre now."""
        scale = self.looks.scale
        return center_px[0] + scale * self.aside_px[0], center_px[1] + scale * self.aside_px[1]

    def saw_right(self, stamp_s: float, left_px: Pixel, views: tuple[EyeView, EyeView], right_px: Pixel) -> None:
        """Keep its parallax, the angle between the two eyes' rays, which changes slowly whatever the eyes do."""
        self.right_seen_s = stamp_s
        self.absolute_rad = _across(views[1].direction(right_px)) - _across(views[0].direction(left_px))

    def disparity_age_s(self, stamp_s: float) -> float:
        """Return how long ago it was last seen in the right eye."""
        return stamp_s - self.right_seen_s

    def expected_disparity(self, left_px: Pixel, views: tuple[EyeView, EyeView]) -> float | None:
        """Return the disparity it should have at a left pixel with the eyes as they are, None if never measured."""
        if math.isnan(self.absolute_rad):
            return None
        left = views[0].direction(left_px)
        angle = _across(left) + self.absolute_rad
        # Same elevation about the baseline, turned across by the parallax.
        forward = left * np.array([1.0, 0.0, 1.0])
        forward /= np.linalg.norm(forward)
        right = forward * math.cos(angle) + np.array([0.0, math.sin(angle), 0.0])
        x = views[1].pixel(right)[0]
        return left_px[0] - x if math.isfinite(x) else None


def _across(direction: np.ndarray) -> float:
    """Return a direction's angle across, towards the left, in the plane through the baseline [rad]."""
    return math.asin(min(max(float(direction[1]), -1.0), 1.0))
