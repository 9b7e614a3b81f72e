"""Disparity by phase correlation: the slope of the cross-power spectrum's phase.

The whole shift is the peak of the whitened correlation (Kuglin and Hines, 1975); the rest is a plane fitted to the
phases that are left, weighted by the power that carries them (after Stone et al., "A fast direct Fourier-based
algorithm for subpixel registration of images", 2001).
"""

import math

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import FoveaPair
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.search import Match
from vergence_metric.disparity.shared_search import LocalDisparity
from vergence_metric.disparity.windows import measuring_window_px, side_of, tapered, window_about

_ROUNDS = 3
_BAND = 0.25  # cycles per pixel; above, aliasing and noise
_WHITENING = 0.02  # share of the mean power below which a frequency counts less


def measure_phase(pair: FoveaPair, match: Match, parameters: DisparityParameters) -> LocalDisparity | None:
    """Return the disparity by phase about a match; None where the two windows share no power."""
    sigma = measuring_window_px(match, parameters)
    side = side_of(sigma)
    left, right = pair.full
    x, y = pair.point_px
    d, v = match.horizontal_px, match.vertical_px
    reference = np.fft.fft2(tapered(window_about(left, x, y, side), sigma))
    spread = math.nan
    for _ in range(_ROUNDS):
        other = np.fft.fft2(tapered(window_about(right, x - d, y - v, side), sigma))
        step = _shift(reference * np.conj(other))
        if step is None:
            return None
        d, v, spread = d + step[0], v + step[1], step[2]
        if math.hypot(d - match.horizontal_px, v - match.vertical_px) > sigma:
            return None
    return LocalDisparity(d, v, spread)


def _shift(cross: NDArray[np.complex128]) -> tuple[float, float, float] | None:
    """Return (x, y) by which the first window's content lies right of and below the second's, and x's deviation."""
    power = np.abs(cross)
    mean = float(power.mean())
    if mean <= 1e-9:
        return None
    side = cross.shape[0]
    correlation = np.fft.ifft2(cross / (power + _WHITENING * mean)).real
    row, column = divmod(int(correlation.argmax()), side)
    whole_x, whole_y = ((k + side // 2) % side - side // 2 for k in (column, row))
    fy, fx = np.meshgrid(np.fft.fftfreq(side), np.fft.fftfreq(side), indexing="ij")
    used = (np.hypot(fx, fy) < _BAND) & (power > mean * _WHITENING)
    angle = np.angle(cross[used] * np.exp(2j * np.pi * (fx[used] * whole_x + fy[used] * whole_y)))
    design = -2 * np.pi * np.column_stack([fx[used], fy[used]])
    # A phase that is more than a quarter turn off carries no slope, only a wrong match at that frequency.
    weights = power[used] * (np.abs(angle) < np.pi / 2)
    normal = np.einsum("n,ni,nj->ij", weights, design, design)
    if np.linalg.det(normal) <= 1e-12 * normal[0, 0] * normal[1, 1]:
        return None
    inverse = np.linalg.inv(normal)
    slope = inverse @ np.einsum("n,ni->i", weights * angle, design)
    residual = angle - design[:, 0] * slope[0] - design[:, 1] * slope[1]
    influence = weights * residual * (design[:, 0] * inverse[0, 0] + design[:, 1] * inverse[0, 1])
    variance = float((influence**2).sum())
    return whole_x + float(slope[0]), whole_y + float(slope[1]), math.sqrt(max(variance, 0.0))
