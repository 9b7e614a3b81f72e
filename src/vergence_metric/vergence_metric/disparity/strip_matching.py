"""Semi-global matching of a strip about one point: what its surroundings say about its disparity.

A whole frame's matching costs hundreds of milliseconds; a point needs only the rows and columns about it. The strip is
matched at half resolution over the whole range, then at full resolution over the disparities that occur there
(Hirschmueller, "Stereo processing by semiglobal matching and mutual information", 2008; OpenCV's implementation).
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image, Point

_BLOCK_PX = 3
_SMALL_STEP, _LARGE_STEP = 4 * _BLOCK_PX**2, 16 * _BLOCK_PX**2  # half of what OpenCV recommends: thin things stay
_COARSE_HALF_PX = (48, 32)  # half width and half height of the strip, full-resolution pixels
_FINE_HALF_PX = (36, 28)
_RETURN_HALF_PX = (16, 12)
LARGEST_HALF_PX = max(_COARSE_HALF_PX[1], _FINE_HALF_PX[1], _RETURN_HALF_PX[1])
"""Rows above and below the point that any strip covers, beside the vertical disparity."""

_GRAIN = 16  # OpenCV searches whole multiples of this
_STEPS = 16  # of OpenCV's disparities in a pixel


@dataclass(frozen=True)
class DisparityPatch:
    """Disparities about a point: `disparity_px` (h, w), NaN where unknown; [j, i] is the pixel (x0 + i, y0 + j)."""

    disparity_px: NDArray[np.float32]
    x0: int
    y0: int

    def at(self, x: float, y: float) -> float:
        """Return the disparity at a pixel, NaN where it is unknown or outside."""
        i, j = round(x) - self.x0, round(y) - self.y0
        h, w = self.disparity_px.shape
        return float(self.disparity_px[j, i]) if 0 <= i < w and 0 <= j < h else float("nan")

    def about(self, x: float, y: float, half_px: int) -> NDArray[np.float32]:
        """Return the known disparities in the square about a pixel (n)."""
        i, j = round(x) - self.x0, round(y) - self.y0
        near = self.disparity_px[max(j - half_px, 0) : j + half_px + 1, max(i - half_px, 0) : i + half_px + 1]
        return near[np.isfinite(near)]


def coarse(left: Image, right: Image, point: Point, vertical_px: int, largest_px: int) -> DisparityPatch:
    """Match the strip about a point at half resolution, disparities of both signs up to `largest_px`."""
    (half_w, half_h), half = _COARSE_HALF_PX, _up(largest_px, 2 * _GRAIN) // 2
    x0, y0 = round(point[0]) - half_w, round(point[1]) - half_h
    pad = 2 * half
    halves: list[Image] = [
        cv2.resize(
            cut(image, x0 - pad, y, 2 * (half_w + pad), 2 * half_h), None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA
        )
        for image, y in ((left, y0), (right, y0 - vertical_px))
    ]
    matched = _match(halves, -half, 2 * half)[:, half:-half]
    return DisparityPatch(2.0 * cv2.resize(matched, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST), x0, y0)


def fine(left: Image, right: Image, point: Point, vertical_px: int, span_px: tuple[int, int]) -> DisparityPatch:
    """Match the strip about a point at full resolution, disparities from the first of `span_px` to the second."""
    (half_w, half_h), low, count = _FINE_HALF_PX, span_px[0], _up(span_px[1] - span_px[0] + 1, _GRAIN)
    before, after = max(low + count - 1, 0), max(-low, 0)
    x0, y0 = round(point[0]) - half_w, round(point[1]) - half_h
    width = before + 2 * half_w + after
    crops: list[Image] = [cut(i, x0 - before, y, width, 2 * half_h) for i, y in ((left, y0), (right, y0 - vertical_px))]
    return DisparityPatch(_match(crops, low, count)[:, before : before + 2 * half_w], x0, y0)


def returned(left: Image, right: Image, at: Point, vertical_px: int, span_px: tuple[int, int]) -> float:
    """Return the disparity that matching back from a point of the right image finds there, NaN if none."""
    (half_w, half_h), low, count = _RETURN_HALF_PX, span_px[0], _up(span_px[1] - span_px[0] + 1, _GRAIN)
    before, after = max(-low, 0), max(low + count - 1, 0)
    x0, y0 = round(at[0]) - half_w, round(at[1]) - half_h
    width = before + 2 * half_w + after
    # Seen in a mirror, the right image is a left one.
    crops: list[Image] = [
        cv2.flip(cut(i, x0 - before, y, width, 2 * half_h), 1) for i, y in ((right, y0), (left, y0 + vertical_px))
    ]
    found = _match(crops, low, count)
    return float(found[half_h, width - 1 - (round(at[0]) - x0 + before)])


def _up(value: int, grain: int) -> int:
    return -(-value // grain) * grain


def _match(crops: list[Image], low: int, count: int) -> NDArray[np.float32]:
    """Return the disparities (h, w) of the first crop, that of the left eye, in the second; NaN where unknown."""
    matcher = cv2.StereoSGBM_create(  # type: ignore[attr-defined]  # missing in OpenCV's own type stubs
        minDisparity=low,
        numDisparities=count,
        blockSize=_BLOCK_PX,
        P1=_SMALL_STEP,
        P2=_LARGE_STEP,
        disp12MaxDiff=-1,
        mode=cv2.STEREO_SGBM_MODE_HH,
    )
    fixed = matcher.compute(*crops)
    disparity_px = fixed.astype(np.float32)
    disparity_px *= np.float32(1.0 / _STEPS)
    disparity_px[fixed < _STEPS * low] = np.nan
    return disparity_px
