"""The zero-disparity filter: the region at one disparity, as a mask, a centroid and an extent.

After Coombs and Brown, "Real-time binocular smooth pursuit" (1993): the features whose disparity is that of the
fixation point belong to the target, whatever it is. A feature here is a pixel with enough gradient about it; it passes
if the two images match there better at the given disparity than at those around it. The mask is closed between the
features and taken as one connected region at the fovea.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import cut
from vergence_metric.disparity.protocol import Image

_WINDOW_PX = 9  # over which differences are averaged
_GUARD_PX = 4  # disparities compared beyond the tolerance on both sides
_LOCAL_MEAN_PX = 8.0
_MINIMUM_GRADIENT = 4.0  # grey levels per pixel, averaged over the window
_ADVANTAGE = 0.85  # ratio to the best disparity outside, at most
_MAX_RESIDUAL = 0.5  # of a match, as a share of the local contrast; unrelated patches have about 1.4
_NOISE = 2.0  # grey levels, mean absolute difference
_CLOSING_PX = 11
_OPENING_PX = 7  # thinner outgrowths are noise
_MINIMUM_AREA_PX = 40


@dataclass(frozen=True)
class ZeroDisparity:
    """The region at one disparity.

    `mask` (h, w) bool covers an area of the left image whose top-left pixel is `origin_px`. `centroid_px` (x, y) and
    `extent_px` (sides of the rectangle of equal second moments) are in the left image, NaN if there is no region.
    `features` counts the pixels that passed; `touches_border`: the region may extend beyond the area.
    """

    mask: NDArray[np.bool_]
    origin_px: tuple[int, int]
    centroid_px: tuple[float, float]
    extent_px: tuple[float, float]
    area_px: int
    features: int
    touches_border: bool

    @property
    def found(self) -> bool:
        """True if there is a region at the disparity."""
        return self.area_px > 0


def zero_disparity(
    left: Image,
    right: Image,
    center_px: tuple[float, float] | None = None,
    disparity_px: tuple[float, float] = (0.0, 0.0),
    tolerance_px: int = 1,
    half_side_px: int = 110,
    reach_px: float = 20.0,
) -> ZeroDisparity:
    """Return the region of a disparity at or near a point of the left image.

    Args:
        left: (h, w) grey image of the left eye.
        right: (h, w) grey image of the right eye, aligned.
        center_px: (x, y) of the area's centre; None for the image's centre.
        disparity_px: horizontal and vertical disparity, rounded to whole pixels.
        tolerance_px: largest difference from the disparity within the region.
        half_side_px: half the side of the area.
        reach_px: largest distance of the region from the centre.

    """
    height, width = left.shape
    x, y = center_px if center_px is not None else ((width - 1) / 2, (height - 1) / 2)
    side = 2 * half_side_px + 1
    x0, y0 = round(x) - half_side_px, round(y) - half_side_px
    d, v = round(disparity_px[0]), round(disparity_px[1])
    spread = tolerance_px + _GUARD_PX
    flat_left = _without_mean(cut(left, x0, y0, side, side))
    flat_right = _without_mean(cut(right, x0 - d - spread, y0 - v, side + 2 * spread, side))
    agreement, beside = _costs(flat_left, flat_right, tolerance_px, spread)
    gradient = cv2.boxFilter(np.abs(cv2.Sobel(flat_left, cv2.CV_32F, 1, 0, scale=0.125)), -1, (_WINDOW_PX, _WINDOW_PX))
    contrast = cv2.boxFilter(np.abs(flat_left), -1, (_WINDOW_PX, _WINDOW_PX))
    passed = (agreement < _ADVANTAGE * beside) & (agreement < _MAX_RESIDUAL * contrast + _NOISE)
    passed &= gradient > _MINIMUM_GRADIENT / 2
    passed &= _inside(x0, y0, d, side, width, height)
    return _region(passed, (x0, y0), (x, y), reach_px)


def _without_mean(crop: Image) -> NDArray[np.float32]:
    grey = crop.astype(np.float32)
    return grey - cv2.GaussianBlur(grey, (0, 0), _LOCAL_MEAN_PX)


def _costs(
    left: NDArray[np.float32], right: NDArray[np.float32], tolerance: int, spread: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the smallest mean absolute difference within the tolerance, and that outside of it, for each pixel."""
    width = left.shape[1]
    # The eyes' gains differ; one gain for the whole area keeps the differences comparable.
    gain = float(left.std() / max(right.std(), 1e-3))
    scaled = right * min(max(gain, 0.5), 2.0)
    inner = np.full(left.shape, np.inf, np.float32)
    outer = np.full(left.shape, np.inf, np.float32)
    for shift in range(-spread, spread + 1):
        column = spread - shift  # x_right = x_left - d
        shifted = np.ascontiguousarray(scaled[:, column : column + width])
        cost = cv2.boxFilter(cv2.absdiff(left, shifted), -1, (_WINDOW_PX, _WINDOW_PX))
        if abs(shift) <= tolerance:
            np.minimum(inner, cost, out=inner)
        else:
            np.minimum(outer, cost, out=outer)
    return inner, outer


def _inside(x0: int, y0: int, d: int, side: int, width: int, height: int) -> NDArray[np.bool_]:
    xs, ys = np.arange(x0, x0 + side), np.arange(y0, y0 + side)
    across = (xs >= 0) & (xs < width) & (xs - d >= 0) & (xs - d < width)
    return ((ys >= 0) & (ys < height))[:, None] & across[None, :]


def _region(
    passed: NDArray[np.bool_], origin: tuple[int, int], point: tuple[float, float], reach_px: float
) -> ZeroDisparity:
    """Close the passed pixels into regions and take the one at the point, else the nearest within reach."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_CLOSING_PX, _CLOSING_PX))
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    opened = cv2.morphologyEx(passed.astype(np.uint8), cv2.MORPH_OPEN, small)
    # Padded, so that the closing does not attach to the border of the area.
    padded = cv2.copyMakeBorder(opened, *(_CLOSING_PX,) * 4, cv2.BORDER_CONSTANT, value=0)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, disc)[_CLOSING_PX:-_CLOSING_PX, _CLOSING_PX:-_CLOSING_PX]
    count, labels, stats, _ = cv2.connectedComponentsWithStats(np.ascontiguousarray(closed), connectivity=4)
    nothing = ZeroDisparity(
        np.zeros(passed.shape, bool), origin, (math.nan, math.nan), (math.nan, math.nan), 0, int(passed.sum()), False
    )
    if count < 2:
        return nothing
    ys, xs = np.nonzero(closed)
    distance = np.hypot(xs + origin[0] - point[0], ys + origin[1] - point[1])
    order = labels[ys, xs]
    nearest = np.full(count, np.inf)
    np.minimum.at(nearest, order, distance)
    areas = stats[:, cv2.CC_STAT_AREA]
    fit = (nearest <= reach_px) & (areas >= _MINIMUM_AREA_PX)
    fit[0] = False
    if not fit.any():
        return nothing
    chosen = int(np.argmin(np.where(fit, nearest, np.inf)))
    mask = _trimmed(filled(labels == chosen))
    ys, xs = np.nonzero(mask)
    if len(xs) == 0:
        return nothing
    side = passed.shape[0]
    return ZeroDisparity(
        mask,
        origin,
        (float(xs.mean()) + origin[0], float(ys.mean()) + origin[1]),
        (_side(xs), _side(ys)),
        len(xs),
        int((passed & mask).sum()),
        bool(xs.min() == 0 or ys.min() == 0 or xs.max() == side - 1 or ys.max() == side - 1),
    )


def _side(coordinates: NDArray[np.intp]) -> float:
    """Return the side of the uniform bar of equal variance; thin outgrowths of a region hardly add to it."""
    return math.sqrt(12.0 * float(coordinates.var()) + 1.0)


def _trimmed(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the largest part that is left after removing thin outgrowths."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (_OPENING_PX, _OPENING_PX))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(opened, connectivity=4)
    if count < 2:
        return np.zeros(mask.shape, bool)
    return np.asarray(labels == 1 + int(stats[1:, cv2.CC_STAT_AREA].argmax()))


def filled(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the mask with its holes filled."""
    padded = cv2.copyMakeBorder(mask.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    outside = padded.copy()
    cv2.floodFill(outside, None, (0, 0), 2)
    return np.asarray((outside != 2)[1:-1, 1:-1])
