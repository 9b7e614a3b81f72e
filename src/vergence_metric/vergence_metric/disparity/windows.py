"""Windows of a crop about a point: resampled, tapered, and of a size that suits a match."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import radius_of
from vergence_metric.disparity.fovea_pair import Grey, Strip
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.search import Match


def window_about(strip: Strip, x: float, y: float, side: int) -> Grey:
    """Return the (side, side) window whose centre is the point (x, y) of the full image, resampled."""
    center = (x - strip.x0, y - strip.y0)
    return np.asarray(cv2.getRectSubPix(strip.grey, (side, side), center, patchType=cv2.CV_32F))


def tapered(window: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Return the window less its weighted mean, faded out by a Gaussian."""
    half = (window.shape[0] - 1) / 2
    line = np.exp(-0.5 * ((np.arange(window.shape[0]) - half) / sigma) ** 2).astype(np.float32)
    weights = np.outer(line, line)
    return (window - float((weights * window).sum() / weights.sum())) * weights


def measuring_window_px(match: Match, parameters: DisparityParameters) -> float:
    """Return the window to measure in: the one that decided, as it holds one surface, but at least the second one."""
    windows = parameters.windows_px
    return max(match.window_px, windows[min(1, len(windows) - 1)])


def side_of(sigma: float) -> int:
    """Return the side of a window that holds a Gaussian of this deviation, a whole multiple of 8."""
    return 8 * math.ceil((2 * radius_of(sigma) + 1) / 8)
