"""The locked target: prediction of its direction and disparity, independent of the motion of the eyes."""

import itertools
import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from vergence_metric.disparity.protocol import Image
from vergence_metric.tracking.depth_hypotheses import DepthHypotheses
from vergence_metric.tracking.eye_view import EyeView, Pixel
from vergence_metric.tracking.own_pixels import SurfaceMasks
from vergence_metric.tracking.remembered_patch import RememberedPatch
from vergence_metric.tracking.target_appearance import TargetAppearance

_MOTION_MEMORY = 0.6  # share of the old angular velocity kept at each frame
_COAST_HALF_LIFE_S = 0.7  # a hidden target's predicted velocity fades: it may have stopped
_COAST_FROM_S = 0.3  # a hidden target is predicted by its velocity over this time, not by its last two sightings
_SLOPE_OVER_S = 0.06
_SEGMENTED_EVERY = 32
_LEAST_PARALLAX_RAD = 0.005  # below it a target counts as far away


@dataclass
class Target:
    """State of the locked target, in directions of rig_base, which do not change when the eyes move."""

    track_id: int
    lock_stamp_s: float
    appearance: TargetAppearance
    seen_s: float
    views: tuple[EyeView, EyeView]  # the eyes' latest
    direction: np.ndarray  # unit vector in rig_base from the left lens there, as last seen
    velocity: np.ndarray  # of that vector, per second
    bounded: bool  # its region was segmented
    aside_px: Pixel = (0.0, 0.0)  # from its region's centre to the fovea when locked on
    hidden: bool = False
    right_seen_s: float = -math.inf
    matched_vergence_rad: float = math.nan  # of the eyes by their joints, when last matched in the right eye
    parallax_rad: float = math.nan  # angle from the left eye's ray to the right eye's, in the plane of the baseline
    patch: RememberedPatch | None = None  # of a requested target
    masks: SurfaceMasks | None = None  # of a requested target
    depths: DepthHypotheses | None = None  # of a requested target
    found: bool = True  # since its request
    most_at_point: float = 0.0  # of a requested target: what noise leaves of the point's similarity with itself
    off_px: float = 0.0  # of a requested target: how far from its expected place it was found last
    goal_id: int = 0
    sightings: deque[tuple[float, np.ndarray]] = field(default_factory=deque)  # recent stamps and directions
    unbounded_pairs: int = 0  # in which it might have been segmented

    @property
    def distance_m(self) -> float:
        """From the left lens, by the parallax; that of its surroundings where it is not known, inf without either."""
        if math.isnan(self.parallax_rad) and self.patch is not None and self.patch.surroundings_m is not None:
            return self.patch.surroundings_m
        return distance_of_parallax(self.parallax_rad, self.direction, self.views)

    def own(self, scale: int) -> Image | None:
        """Return the mask (h, w) of its own surface where it was seen at its request; None where it is not known."""
        if self.masks is None or self.depths is None:
            return None
        # Parallaxes change by what the joints report wrongly, and may seem new: what counts is with which they began.
        masks = (self.masks.mask(one.first_rad, scale) for one in self.depths.ranked)
        return next((mask for mask in masks if mask is not None), None)

    def turn_to(self, views: tuple[EyeView, EyeView]) -> None:
        """Give the direction from where the left lens is by now."""
        self.direction = views[0].direction_of(self.direction, self.views[0], self.distance_m)
        self.views = views

    def segmentation_due(self) -> bool:
        """Count a pair in which a target without bounds could be segmented; returns whether it is to be tried.

        The 1st, 2nd, 4th, 8th time and so on, then every 32nd: what has no bounds in one pair hardly has them in the
        next, and looking for them costs as much as all the rest.
        """
        self.unbounded_pairs += 1
        n = self.unbounded_pairs
        return n & (n - 1) == 0 or n % _SEGMENTED_EVERY == 0

    def predicted(self, stamp_s: float) -> np.ndarray:
        """Return the predicted direction (3,) at a stamp."""
        elapsed = stamp_s - self.seen_s
        rate = math.log(2.0) / _COAST_HALF_LIFE_S
        if self.hidden:
            direction = self.direction + self._steady_velocity() * (1.0 - math.exp(-rate * elapsed)) / rate
        else:
            direction = self.direction + self.velocity * elapsed
        return np.asarray(direction / np.linalg.norm(direction))

    def update_direction(self, stamp_s: float, direction: np.ndarray) -> None:
        """Update direction and velocity with a sighting."""
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
        """Return the velocity (3,) over the recent sightings, robust to single ones (Theil-Sen median slope).

        While the eyes move fast their joint angles are less exact, and an occluder first shifts the measured position.
        """
        pairs = itertools.combinations(self.sightings, 2)
        slopes = [(b - a) / (t - s) for (s, a), (t, b) in pairs if t - s >= _SLOPE_OVER_S]
        return np.median(slopes, axis=0) if slopes else np.zeros(3)

    def fixated_px(self, center_px: Pixel) -> Pixel:
        """Return the pixel of the point that was fixated at the lock, for the present centre."""
        scale = self.appearance.scale
        return center_px[0] + scale * self.aside_px[0], center_px[1] + scale * self.aside_px[1]

    def update_parallax(self, stamp_s: float, left_px: Pixel, views: tuple[EyeView, EyeView], right_px: Pixel) -> None:
        """Update the parallax, the angle between the two eyes' rays, which does not depend on the eyes' motion."""
        self.right_seen_s, self.matched_vergence_rad = stamp_s, vergence_of(views)
        self.parallax_rad = parallax(left_px, views, right_px)

    def disparity_age_s(self, stamp_s: float) -> float:
        """Return the time since the target was last matched in the right eye [s]."""
        return stamp_s - self.right_seen_s

    def expected_disparity(self, left_px: Pixel, views: tuple[EyeView, EyeView]) -> float | None:
        """Return the predicted disparity at a left pixel with the eyes in `views`, None if never measured."""
        if math.isnan(self.parallax_rad):
            return None
        return disparity_of_parallax(self.parallax_rad, left_px, views)


def disparity_of_parallax(parallax_rad: float, left_px: Pixel, views: tuple[EyeView, EyeView]) -> float | None:
    """Return the disparity that a parallax gives at a left pixel, None if the right eye could not see it."""
    left = views[0].direction(left_px)
    angle = _across(left) + parallax_rad
    # Same elevation about the baseline, rotated by the parallax.
    forward = left * np.array([1.0, 0.0, 1.0])
    forward /= np.linalg.norm(forward)
    right = forward * math.cos(angle) + np.array([0.0, math.sin(angle), 0.0])
    x = views[1].pixel(right)[0]
    return left_px[0] - x if math.isfinite(x) else None


def distance_of_parallax(parallax_rad: float, direction: np.ndarray, views: tuple[EyeView, EyeView]) -> float:
    """Return how far from the left lens a parallax lies in a direction (3,) [m]; inf where that cannot be known."""
    if not parallax_rad > _LEAST_PARALLAX_RAD:
        return math.inf
    baseline_m = views[0].lens_m[1] - views[1].lens_m[1]
    return baseline_m * math.cos(_across(direction) + parallax_rad) / math.sin(parallax_rad)


def parallax(left_px: Pixel, views: tuple[EyeView, EyeView], right_px: Pixel) -> float:
    """Return the angle from the left eye's ray to the right eye's, in the plane of the baseline [rad]."""
    return _across(views[1].direction(right_px)) - _across(views[0].direction(left_px))


def vergence_of(views: tuple[EyeView, EyeView]) -> float:
    """Return the eyes' vergence by their joints [rad]."""
    return views[1].pan_rad - views[0].pan_rad


def _across(direction: np.ndarray) -> float:
    """Return a direction's angle in the plane of the baseline, towards the left [rad]."""
    return math.asin(min(max(float(direction[1]), -1.0), 1.0))
