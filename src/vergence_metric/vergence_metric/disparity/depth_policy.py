"""Which surface's disparity is estimated where several depths are in view.

`center` estimates at the point itself. The other policies first match the surroundings coarsely (semi-global matching
at half resolution), group the disparities into layers of one depth, choose a layer (`nearest`, `largest`, or the
largest one inside a `box`) and estimate at a point well inside it.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.protocol import Disparity, DisparityEstimator, DisparityStatus, Image, Point

_HALF_SIDE_PX = 100
_BIN_PX = 2.0
_SMALLEST_AREA_PX = 300
_BLOCK_PX = 5


@dataclass(frozen=True)
class Layer:
    """What lies at one depth: its median disparity [px], its area [px^2] and a point (x, y) well inside of it."""

    disparity_px: float
    area_px: float
    point_px: tuple[float, float]


class DepthPolicyEstimator(DisparityEstimator):
    """Runs another estimator at the point that the policy chooses; `point_px` of the result is that point."""

    def __init__(self, estimator: DisparityEstimator, parameters: DisparityParameters) -> None:
        self.name = estimator.name
        self._estimator, self._parameters = estimator, parameters

    def estimate_at(self, left: Image, right: Image, point_px: Point, expected_px: float | None) -> Disparity:
        """Return the disparity of the layer that the policy chooses about a point; see DisparityEstimator."""
        seen = layers(left, right, self._area(left, point_px), self._parameters.max_px)
        if not seen:
            found = self._estimator.estimate(left, right, point_px, expected_px)
            if not found.ok:
                return found
            reason = f"no layer is large enough for the policy {self._parameters.depth_policy}"
            return replace(
                found, confidence=min(found.confidence, 0.5), status=DisparityStatus.AMBIGUOUS, reason=reason
            )
        if self._parameters.depth_policy == "nearest":
            chosen = max(seen, key=lambda layer: layer.disparity_px)
        else:
            chosen = max(seen, key=lambda layer: layer.area_px)
        return self._estimator.estimate(left, right, chosen.point_px, chosen.disparity_px)

    def _area(self, left: Image, point: Point) -> tuple[int, int, int, int]:
        """Return x, y, width and height of the area that is matched: the box, or a square about the point."""
        height, width = left.shape
        if self._parameters.depth_policy == "box":
            x_min, y_min, x_max, y_max = (round(side) for side in self._parameters.box_px)
        else:
            x_min, y_min = round(point[0]) - _HALF_SIDE_PX, round(point[1]) - _HALF_SIDE_PX
            x_max, y_max = x_min + 2 * _HALF_SIDE_PX, y_min + 2 * _HALF_SIDE_PX
        x_min, y_min = max(x_min, 0), max(y_min, 0)
        return x_min, y_min, max(min(x_max, width - 1) - x_min + 1, 0), max(min(y_max, height - 1) - y_min + 1, 0)


def layers(left: Image, right: Image, area: tuple[int, int, int, int], max_px: int) -> list[Layer]:
    """Return the layers of depth inside an area (x, y, width, height) of the left image, the nearest first."""
    x, y, width, height = area
    if width < 2 * _BLOCK_PX or height < 2 * _BLOCK_PX:
        return []
    steps = 16 * -(-max_px // 16)
    crops = [cut(image, x - steps, y, width + 2 * steps, height) for image in (left, right)]
    halves = [cv2.pyrDown(crop) for crop in crops]
    matcher = cv2.StereoSGBM_create(  # type: ignore[attr-defined]  # missing in OpenCV's own type stubs
        minDisparity=-steps // 2,
        numDisparities=steps,
        blockSize=_BLOCK_PX,
        P1=8 * _BLOCK_PX**2,
        P2=32 * _BLOCK_PX**2,
        uniquenessRatio=10,
        disp12MaxDiff=1,
        speckleWindowSize=40,
        speckleRange=2,
    )
    fixed = matcher.compute(*halves)[:, steps // 2 : -(steps // 2)]
    disparities = np.where(fixed >= -8 * steps, fixed / 8.0, np.nan).astype(np.float32)
    return _sorted_into_layers(disparities, (x, y))


def _sorted_into_layers(disparities: NDArray[np.float32], origin: tuple[int, int]) -> list[Layer]:
    """Cut the disparities (half resolution, full-resolution pixels, NaN unknown) where their histogram has gaps."""
    known = disparities[np.isfinite(disparities)]
    if known.size * 4 < _SMALLEST_AREA_PX:
        return []
    low = float(known.min())
    bins = np.bincount(((known - low) / _BIN_PX).astype(int))
    smooth = np.convolve(bins, [1.0, 2.0, 1.0], mode="same") / 4.0
    filled = np.concatenate([[False], smooth > max(0.004 * known.size, 2.0), [False]])
    starts = np.flatnonzero(~filled[:-1] & filled[1:])
    ends = np.flatnonzero(filled[:-1] & ~filled[1:])
    found = []
    for start, end in zip(starts, ends, strict=True):
        mask = (disparities >= low + _BIN_PX * start) & (disparities < low + _BIN_PX * end)
        if int(mask.sum()) * 4 < _SMALLEST_AREA_PX:
            continue
        padded = cv2.copyMakeBorder(mask.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
        depth = cv2.distanceTransform(padded, cv2.DIST_L2, 3)[1:-1, 1:-1]
        j, i = divmod(int(depth.argmax()), depth.shape[1])
        disparity_px = float(np.median(disparities[mask]))
        found.append(Layer(disparity_px, 4.0 * int(mask.sum()), (origin[0] + 2.0 * i, origin[1] + 2.0 * j)))
    return sorted(found, key=lambda layer: -layer.disparity_px)
