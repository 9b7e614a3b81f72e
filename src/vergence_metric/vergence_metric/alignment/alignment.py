"""Taking vertical offset and roll between the eyes out of the right image before anything is compared.

Thirteen pixels of vertical offset hide vergence altogether. The offset and roll come from the mounts, so they are taken
from calibration, or estimated from the pairs and filtered over time.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from vergence_metric.alignment.misalignment import Misalignment, estimate_misalignment
from vergence_metric.edges.edges import Grey
from vergence_metric.edges.parameters import EdgeMetricParameters

_EAGER_PAIRS = 5  # at first every pair is looked at
_NEGLIGIBLE_PX = 0.05
_GATE_SIGMAS, _GATE_PX = 4.0, 1.0
_REJECTIONS_TO_RESTART = 5


@dataclass(frozen=True)
class Alignment:
    """What is taken out of the right image.

    `vertical_px` is y_left - y_right at the centre, `roll_rad` the right image's rotation, clockwise in the image
    positive. `bounded`: the estimate was larger than allowed and was clipped. `estimated` is False where mode is auto
    and no pair has shown anything yet.
    """

    mode: str
    vertical_px: float = 0.0
    roll_rad: float = 0.0
    bounded: bool = False
    estimated: bool = True

    def apply(self, right: Grey) -> Grey:
        """Return the (h, w) `right` image as an eye without offset and roll would see it.

        The image's centre keeps its column, so that horizontal disparity there is not disturbed. Where there is next to
        nothing to take out, the image is returned as it is, not copied.
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
        """Return where a point of the aligned right image lies in the right image as it was taken [px]."""
        cos, sin = math.cos(self.roll_rad), math.sin(self.roll_rad)
        centre_x, centre_y = (width_px - 1) / 2.0, (height_px - 1) / 2.0
        dx, dy = x_px - centre_x, y_px - centre_y
        return centre_x + cos * dx - sin * dy, centre_y + sin * dx + cos * dy - self.vertical_px


class Aligner:
    """Tells the alignment of pair after pair, as the parameters ask: none, calibrated, or auto.

    Auto estimates offset and roll from every one of the first few pairs, then from one in `align_every_pairs`, and
    filters each with a scalar Kalman filter. An estimate far from what is known is left out, unless several in a row
    are. The first few count for their own pair; the later ones take as long as the rest of a pair's work, so that they
    are put off: to `settle`, for which there is time once the pair's figures are out, or to the next pair.
    """

    def __init__(self, parameters: EdgeMetricParameters) -> None:
        self._parameters = parameters
        self._pairs = 0
        self._rejected = 0
        self._estimated = False
        self._vertical, self._roll = _ignorance()
        self._due: tuple[Grey, Grey] | None = None

    def update(self, left: Grey, right: Grey) -> Alignment:
        """Return the alignment of this pair of (h, w) uint8 images, given all that came before it."""
        p = self._parameters
        if p.align == "none":
            return Alignment("none")
        if p.align == "calibrated":
            return Alignment("calibrated", p.align_vertical_px, math.radians(p.align_roll_deg))
        self.settle()
        if self._pairs < _EAGER_PAIRS:
            self._estimate(left, right)
        elif self._pairs % p.align_every_pairs == 0:
            self._due = left, right
        self._pairs += 1
        most_px, most_rad = p.align_max_vertical_px, math.radians(p.align_max_roll_deg)
        vertical = min(max(self._vertical.value, -most_px), most_px)
        roll = min(max(self._roll.value, -most_rad), most_rad)
        bounded = vertical != self._vertical.value or roll != self._roll.value
        return Alignment("auto", vertical, roll, bounded, self._estimated)

    def settle(self) -> None:
        """Make the estimate that was put off, if any."""
        if self._due is not None:
            due, self._due = self._due, None
            self._estimate(*due)

    def _estimate(self, left: Grey, right: Grey) -> None:
        p = self._parameters
        seen = estimate_misalignment(
            left,
            right,
            search_horizontal_px=p.align_search_px,
            search_vertical_px=math.ceil(p.align_max_vertical_px * 1.5),
        )
        if seen is not None:
            self._take(seen)

    def _take(self, seen: Misalignment) -> None:
        surprising = self._vertical.surprising(seen.vertical_px, seen.vertical_sigma_px)
        if surprising and self._rejected + 1 < _REJECTIONS_TO_RESTART:
            self._rejected += 1
            return
        if surprising:
            self._vertical, self._roll = _ignorance()
        self._rejected, self._estimated = 0, True
        self._vertical.take(seen.vertical_px, seen.vertical_sigma_px)
        self._roll.take(seen.roll_rad, seen.roll_sigma_rad)


class _Filtered:
    """A slowly drifting value, by the estimates of it; `sigma` is what is known before the first."""

    def __init__(self, sigma: float, drift: float) -> None:
        self.value = 0.0
        self._variance, self._drift = sigma**2, drift**2

    def surprising(self, seen: float, sigma: float) -> bool:
        """Tell whether an estimate is hardly one of the same value."""
        return abs(seen - self.value) > _GATE_SIGMAS * math.sqrt(self._variance + sigma**2) + _GATE_PX

    def take(self, seen: float, sigma: float) -> None:
        """Fold in an estimate with its standard deviation."""
        self._variance += self._drift
        gain = self._variance / (self._variance + sigma**2)
        self.value += gain * (seen - self.value)
        self._variance *= 1.0 - gain


def _ignorance() -> tuple[_Filtered, _Filtered]:
    """Return vertical offset [px] and roll [rad] as they are before anything is seen."""
    return _Filtered(sigma=20.0, drift=0.1), _Filtered(sigma=math.radians(1.5), drift=math.radians(0.02))
