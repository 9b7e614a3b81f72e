"""Disparity by the power cepstrum of the two windows side by side.

The right window beside the left one is an echo of it; the logarithm of the power spectrum turns the echo into a ripple,
whose spectrum, the cepstrum, peaks at the echo's distance (Yeshurun and Schwartz, "Cepstral filtering on a columnar
image architecture", 1989; Olson and Coombs, "Real-time vergence control for binocular robots", 1991).
"""

import math

import numpy as np

from vergence_metric.disparity.correlation import parabola
from vergence_metric.disparity.fovea_pair import FoveaPair
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.search import Match
from vergence_metric.disparity.shared_search import LocalDisparity
from vergence_metric.disparity.windows import measuring_window_px, side_of, tapered, window_about

_REACH_PX = 6
_SMALLEST_POWER = 1e-3  # share of the mean power added before the logarithm: noise has no echo
_ROUNDS = 3


def measure_cepstral(pair: FoveaPair, match: Match, parameters: DisparityParameters) -> LocalDisparity | None:
    """Return the disparity by the cepstrum about a match; None where its peak is at the edge of the range."""
    sigma = measuring_window_px(match, parameters)
    side = side_of(sigma)
    left, right = pair.full
    x, y = pair.point_px
    d, v = match.horizontal_px, match.vertical_px
    first = tapered(window_about(left, x, y, side), sigma)
    for _ in range(_ROUNDS):
        second = tapered(window_about(right, x - d, y - v, side), sigma)
        step = _echo(first, second)
        if step is None:
            return None
        # The right window has moved by the step; the cepstrum's own peak is sharp only at whole pixels.
        d, v = d - step[0], v - step[1]
        if math.hypot(*step) < 0.02:
            break
    return LocalDisparity(d, v, 0.1)


def _echo(first: np.ndarray, second: np.ndarray) -> tuple[float, float] | None:
    """Return (x, y) by which the second window's content lies right of and below the first's."""
    side = first.shape[0]
    # Empty room around keeps the echo's multiples away from the echo.
    canvas = np.zeros((2 * side, 4 * side))
    canvas[:side, :side], canvas[:side, side : 2 * side] = first, second
    power = np.abs(np.fft.rfft2(canvas)) ** 2
    cepstrum = np.fft.irfft2(np.log(power + _SMALLEST_POWER * power.mean()), s=canvas.shape)
    rows = np.arange(-_REACH_PX, _REACH_PX + 1)
    peak = cepstrum[np.ix_(rows % canvas.shape[0], side + rows)]
    j, i = divmod(int(peak.argmax()), len(rows))
    if not (0 < i < len(rows) - 1 and 0 < j < len(rows) - 1):
        return None
    across = rows[i] + parabola(peak[j, i - 1], peak[j, i], peak[j, i + 1])
    down = rows[j] + parabola(peak[j - 1, i], peak[j, i], peak[j + 1, i])
    return float(across), float(down)
