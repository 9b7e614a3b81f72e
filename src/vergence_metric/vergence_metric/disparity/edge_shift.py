"""Disparity as the shift that minimises the truncated edge metric: chamfer search on distance transforms.

The same edges and the same nearest-edge distances as metric I, so this is the shift at which the metric is least:
for every shift the mean over one eye's edge pixels of the distance to the other's nearest edge, at most a few pixels,
weighted towards the point, both directions averaged (Barrow et al., "Parametric correspondence and chamfer matching",
1977; Borgefors, 1988).
"""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import FoveaPair, Grey, Strip
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.search import Match
from vergence_metric.disparity.shared_search import LocalDisparity
from vergence_metric.disparity.windows import measuring_window_px

_TRUNCATION_PX = 4.0
_BLUR_PX = 1.2
_REACH_PX = 6
_FEWEST_EDGES = 12
_EDGE_SHARE = 0.15  # of the pixels are edges: the threshold follows the texture


def measure_edge_shift(pair: FoveaPair, match: Match, parameters: DisparityParameters) -> LocalDisparity | None:
    """Return the disparity by edge distances about a match; None without edges or a minimum inside the range."""
    sigma = measuring_window_px(match, parameters)
    radius = math.ceil(2.0 * sigma)
    outer = radius + _REACH_PX
    left, right = pair.full
    at = (round(pair.point_px[0]), round(pair.point_px[1]))
    d, v = round(match.horizontal_px), round(match.vertical_px)
    first, first_distance = _edges(left, at, outer)
    second, second_distance = _edges(right, (at[0] - d, at[1] - v), outer)
    line = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2).astype(np.float32)
    weights = np.outer(line, line)
    inner = slice(_REACH_PX, -_REACH_PX)
    costs = []
    for edges, distance in ((first, second_distance), (second, first_distance)):
        kernel = edges[inner, inner] * weights
        total = float(kernel.sum())
        if int(edges[inner, inner].sum()) < _FEWEST_EDGES:
            return None
        costs.append(cv2.matchTemplate(distance, kernel, cv2.TM_CCORR) / total)
    # Content at the window's column c in the right image, found i columns further, has i less disparity; and the
    # other way round from right to left.
    surface = costs[0][::-1, ::-1] + costs[1]
    j, i = divmod(int(surface.argmin()), surface.shape[1])
    if not (0 < i < surface.shape[1] - 1 and 0 < j < surface.shape[0] - 1):
        return None
    across = _notch(surface[j, i - 1], surface[j, i], surface[j, i + 1])
    down = _notch(surface[j - 1, i], surface[j, i], surface[j + 1, i])
    edge_pixels = float((first[inner, inner] * weights).sum())
    sigma_px = float(surface[j, i]) / 2 / math.sqrt(max(edge_pixels / 4, 1.0))
    return LocalDisparity(d + i - _REACH_PX + across, v + j - _REACH_PX + down, sigma_px)


def _edges(strip: Strip, at: tuple[int, int], half: int) -> tuple[Grey, Grey]:
    """Return the edge mask (0, 1) about a point and the truncated distance of each pixel to the nearest edge."""
    x, y = at[0] - int(strip.x0), at[1] - int(strip.y0)
    margin = 4
    crop = strip.grey[max(y - half - margin, 0) : y + half + margin + 1, x - half - margin : x + half + margin + 1]
    grey = cv2.GaussianBlur(crop, (0, 0), _BLUR_PX)
    byte = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
    gradient = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
    high = float(np.quantile(gradient, 1.0 - _EDGE_SHARE))
    mask = cv2.Canny(byte, 0.5 * high, high, L2gradient=True)
    distance = cv2.distanceTransform(255 - mask, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    cutting = slice(margin, -margin)
    edges: NDArray[np.float32] = (mask[cutting, cutting] > 0).astype(np.float32)
    return edges, np.ascontiguousarray(np.minimum(distance, _TRUNCATION_PX)[cutting, cutting])


def _notch(before: float, at: float, after: float) -> float:
    """Return the offset of a minimum whose flanks are straight: distances grow linearly away from it."""
    steeper = max(float(before), float(after)) - float(at)
    return 0.0 if steeper <= 1e-9 else float(np.clip(0.5 * (float(before) - float(after)) / steeper, -0.5, 0.5))
