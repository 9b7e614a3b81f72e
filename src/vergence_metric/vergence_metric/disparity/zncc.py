"""Disparity by normalised cross-correlation of the fovea, with a sub-pixel peak."""

from vergence_metric.disparity.correlation import correlate
from vergence_metric.disparity.fovea_pair import FoveaPair
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.search import Match, deviation_px
from vergence_metric.disparity.shared_search import LocalDisparity
from vergence_metric.disparity.windows import measuring_window_px

_REACH_PX = 3


def measure_zncc(pair: FoveaPair, match: Match, parameters: DisparityParameters) -> LocalDisparity | None:
    """Return the parabola's peak of the correlation at full resolution, None if it lies at the edge of the range."""
    left, right = pair.full
    at = (round(pair.point_px[0]), round(pair.point_px[1]))
    d, v = round(match.horizontal_px), round(match.vertical_px)
    window_px = measuring_window_px(match, parameters)
    surface = correlate(left, right, at, window_px, (d - _REACH_PX, d + _REACH_PX), (v - _REACH_PX, v + _REACH_PX))
    i, j, value = surface.peak_near(d, _REACH_PX)
    rows, columns = surface.zncc.shape
    if not (0 < i < columns - 1 and 0 < j < rows - 1):
        return None
    horizontal, vertical = surface.subpixel(i, j)
    return LocalDisparity(horizontal, vertical, deviation_px(surface, value))
