"""Removal of vertical offset and roll between the eyes from the right image, before the images are compared.

Thirteen pixels of vertical offset hide vergence completely. Offset and roll come from the mounts: they are calibrated,
or estimated from the pairs and filtered over time.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.alignment.misalignment import Misalignment, estimate_misalignment
from vergence_metric.alignment.parameters import AlignmentParameters

_INITIAL_PAIRS = 5  # estimates on each of the first pairs, at once
_NEGLIGIBLE_PX = 0.05
_GATE_SIGMAS, _GATE_PX = 4.0, 1.0
_REJECTIONS_TO_RESTART = 5
_NEAR_PX = 36  # vertical offsets of usual mounts; of a known offset, its errors and the effect of the gaze

Grey = NDArray[np.uint8]


@dataclass(frozen=True)
class Alignment:
    """Vertical offset and roll that are removed from the right image.

    `vertical_px` is y_left - y_right at the centre, `roll_rad` the right image's rotation, clockwise in the image
    positive. `bounded`: the estimate exceeded its bound and was clipped. `estimated` is False in mode auto before the
    first estimate.
    """

    mode: str
    vertical_px: float = 0.0
    roll_rad: float = 0.0
    bounded: bool = False
    estimated: bool = True

    def apply(self, right: Grey) -> Grey:
        """Return the (h, w) `right` image as an eye without offset and roll would see it.

        The image's centre keeps its column, so that horizontal disparity there is unchanged. With negligible offset and
        roll the image itself is returned, not a copy.
        """
        height, width = right.shape
        if abs(self.vertical_px) < _NEGLIGIBLE_PX and abs(self.roll_rad) * width / 2.0 < _NEGLIGIBLE_PX:
            return right
        cos, sin = math.cos(self.roll_rad), math.sin(self.roll_rad)
        x, y = (width - 1) / 2.0, (height - 1) / 2.0
        right_from_aligned = np.array(
            [[cos, -sin, x - cos * x + sin * y], [sin, cos, y - sin * x - cos * y - self.vertical_px]]
        )
        return cv2.warpAffine(
            right,
            right_from_aligned,
            (width, height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )

    def unaligned(self, x_px: float, y_px: float, width_px: int, height_px: int) -> tuple[float, float]:
        """Return the position in the original right image of a point of the aligned one [px]."""
        cos, sin = math.cos(self.roll_rad), math.sin(self.roll_rad)
        centre_x, centre_y = (width_px - 1) / 2.0, (height_px - 1) / 2.0
        dx, dy = x_px - centre_x, y_px - centre_y
        return centre_x + cos * dx - sin * dy, centre_y + sin * dx + cos * dy - self.vertical_px

    def aligned(self, x_px: float, y_px: float, width_px: int, height_px: int) -> tuple[float, float]:
        """Return the position in the aligned right image of a point of the original one [px]."""
        cos, sin = math.cos(self.roll_rad), math.sin(self.roll_rad)
        centre_x, centre_y = (width_px - 1) / 2.0, (height_px - 1) / 2.0
        dx, dy = x_px - centre_x, y_px - centre_y + self.vertical_px
        return centre_x + cos * dx + sin * dy, centre_y - sin * dx + cos * dy


class Aligner:
    """Determines the alignment of successive pairs by `mode`: none, calibrated, or auto.

    Auto estimates offset and roll from each of the first five pairs, then from one pair in `every_pairs`, and filters
    both with scalar Kalman filters. An estimate outside the gate is rejected, unless several in a row are. The first
    estimates apply to their own pair. Later ones take as long as the rest of a pair's work and are deferred: to
    `update_alignment`, to be called once the pair's results are published, or to the next pair.
    """

    def __init__(self, parameters: AlignmentParameters) -> None:
        self._parameters = parameters
        self._pairs = 0
        self._rejected = 0
        self._estimated = False
        self._vertical, self._roll = _prior()
        self._deferred: tuple[Grey, Grey] | None = None

    def update(self, left: Grey, right: Grey) -> Alignment:
        """Return the alignment of this pair of (h, w) uint8 images, given all that came before it."""
        p = self._parameters
        if p.mode == "none":
            return Alignment("none")
        if p.mode == "calibrated":
            return Alignment("calibrated", p.vertical_px, p.roll_rad)
        self.update_alignment()
        if self._pairs < _INITIAL_PAIRS:
            self._estimate(left, right)
        elif self._pairs % p.every_pairs == 0:
            self._deferred = left, right
        self._pairs += 1
        max_px, max_rad = p.max_vertical_px, p.max_roll_rad
        vertical = min(max(self._vertical.value, -max_px), max_px)
        roll = min(max(self._roll.value, -max_rad), max_rad)
        bounded = vertical != self._vertical.value or roll != self._roll.value
        return Alignment("auto", vertical, roll, bounded, self._estimated)

    def update_alignment(self) -> None:
        """Compute the deferred estimate, if any."""
        if self._deferred is not None:
            deferred, self._deferred = self._deferred, None
            self._estimate(*deferred)

    def _estimate(self, left: Grey, right: Grey) -> None:
        p = self._parameters
        known = self._estimated and not self._rejected
        widest_px = math.ceil(p.max_vertical_px * 1.5)
        near_px = min(widest_px, _NEAR_PX)
        estimate = self._matched(left, right, near_px, self._vertical.value if known else 0.0)
        if estimate is None and not known and near_px < widest_px:
            estimate = self._matched(left, right, widest_px, 0.0)  # many more places look alike: only if none is near
        if estimate is not None:
            self._filter(estimate)

    def _matched(self, left: Grey, right: Grey, reach_px: int, about_px: float) -> Misalignment | None:
        return estimate_misalignment(
            left,
            right,
            search_horizontal_px=self._parameters.search_px,
            search_vertical_px=reach_px,
            about_vertical_px=about_px,
        )

    def _filter(self, estimate: Misalignment) -> None:
        outlier = self._vertical.is_outlier(estimate.vertical_px, estimate.vertical_sigma_px)
        if outlier and self._rejected + 1 < _REJECTIONS_TO_RESTART:
            self._rejected += 1
            return
        if outlier:
            self._vertical, self._roll = _prior()
        self._rejected, self._estimated = 0, True
        self._vertical.update(estimate.vertical_px, estimate.vertical_sigma_px)
        self._roll.update(estimate.roll_rad, estimate.roll_sigma_rad)


class _ScalarKalmanFilter:
    """Estimates a slowly drifting value; `sigma` is its prior standard deviation, `drift` that of a step."""

    def __init__(self, sigma: float, drift: float) -> None:
        self.value = 0.0
        self._variance, self._drift = sigma**2, drift**2

    def is_outlier(self, measured: float, sigma: float) -> bool:
        """Return whether a measurement lies outside the gate."""
        return abs(measured - self.value) > _GATE_SIGMAS * math.sqrt(self._variance + sigma**2) + _GATE_PX

    def update(self, measured: float, sigma: float) -> None:
        """Update with a measurement and its standard deviation."""
        self._variance += self._drift
        gain = self._variance / (self._variance + sigma**2)
        self.value += gain * (measured - self.value)
        self._variance *= 1.0 - gain


def _prior() -> tuple[_ScalarKalmanFilter, _ScalarKalmanFilter]:
    """Return the filters of vertical offset [px] and roll [rad] before the first estimate."""
    return _ScalarKalmanFilter(sigma=40.0, drift=0.1), _ScalarKalmanFilter(
        sigma=math.radians(2.5), drift=math.radians(0.02)
    )
