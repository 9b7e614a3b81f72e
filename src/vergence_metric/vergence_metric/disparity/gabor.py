"""Disparity from the phases of an oriented filter bank, coarse to fine.

Each complex Gabor filter sees the disparity as a phase difference along its orientation (Sanger, "Stereo disparity
computation using Gabor filters", 1988; Fleet and Jepson, 1990); the orientations vote together, each by the energy it
found, as the populations of vergence controllers do (Gibaldi et al., 2010). Long waves bring the shift within reach of
the short ones.
"""

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import FoveaPair
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.search import Match
from vergence_metric.disparity.shared_search import LocalDisparity
from vergence_metric.disparity.windows import side_of, window_about

_WAVELENGTHS_PX = (24.0, 16.0, 11.0, 8.0, 8.0)
_ORIENTATIONS_RAD = tuple(math.radians(a) for a in (0.0, 30.0, 60.0, 90.0, 120.0, 150.0))
_BANDWIDTH = 0.45  # deviation of the envelope in wavelengths: about 1.2 octaves


@lru_cache(maxsize=64)
def _filter(wavelength: float, orientation: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the even and odd part of a Gabor filter without response to a constant."""
    sigma = _BANDWIDTH * wavelength
    radius = math.ceil(2.5 * sigma)
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1].astype(float)
    envelope = np.exp(-0.5 * (x**2 + y**2) / sigma**2)
    wave = np.exp(2j * math.pi * (x * math.cos(orientation) + y * math.sin(orientation)) / wavelength)
    wave = envelope * (wave - (envelope * wave).sum() / envelope.sum())
    wave /= np.abs(wave).sum()
    return wave.real.astype(np.float32), wave.imag.astype(np.float32)


def measure_gabor(pair: FoveaPair, match: Match, parameters: DisparityParameters) -> LocalDisparity | None:
    """Return the disparity by Gabor phases about a match; None where no orientation constrains it across."""
    # Pooled over the window that decided, with no wave that reaches far beyond it.
    sigma = match.window_px
    side = side_of(sigma) + 1
    left, right = pair.full
    x, y = pair.point_px
    d, v = match.horizontal_px, match.vertical_px
    reference = window_about(left, x, y, side)
    half = side // 2
    line = np.exp(-0.5 * ((np.arange(side) - half) / sigma) ** 2)
    weights = np.outer(line, line)
    spread = math.nan
    for wavelength in _WAVELENGTHS_PX:
        if wavelength > max(2.0 * sigma, _WAVELENGTHS_PX[-1]):
            continue
        step = _step(reference, window_about(right, x - d, y - v, side), weights, wavelength)
        if step is None:
            return None
        d, v, spread = d + step[0], v + step[1], step[2]
        if math.hypot(d - match.horizontal_px, v - match.vertical_px) > sigma:
            return None
    return LocalDisparity(d, v, spread)


def _response(window: NDArray[np.float32], wavelength: float, orientation: float) -> NDArray[np.complex128]:
    even, odd = _filter(wavelength, orientation)
    return np.asarray(cv2.filter2D(window, cv2.CV_32F, even) + 1j * cv2.filter2D(window, cv2.CV_32F, odd))


def _step(
    first: NDArray[np.float32], second: NDArray[np.float32], weights: NDArray[np.float64], wavelength: float
) -> tuple[float, float, float] | None:
    """Return (x, y) by which the first window's content lies right of and below the second's, and x's deviation."""
    normal, moment = np.zeros((2, 2)), np.zeros(2)
    misfits = []
    for orientation in _ORIENTATIONS_RAD:
        a, b = _response(first, wavelength, orientation), _response(second, wavelength, orientation)
        cross = complex((weights * a * np.conj(b)).sum())
        energy = float((weights * (np.abs(a) ** 2 + np.abs(b) ** 2)).sum()) / 2
        if energy <= 1e-9:
            continue
        # The filters correlate: content that lies further right has the earlier phase.
        wave = 2 * math.pi / wavelength * np.array([math.cos(orientation), math.sin(orientation)])
        phase = math.atan2(cross.imag, cross.real)
        weight = abs(cross)
        normal += weight * np.outer(wave, wave)
        moment += weight * wave * phase
        misfits.append((weight, wave, phase))
    if not misfits or normal[0, 0] <= 1e-9 or np.linalg.det(normal) <= 1e-6 * normal[0, 0] ** 2:
        return None
    inverse = np.linalg.inv(normal)
    shift = inverse @ moment
    left_over = sum(w * (p - float(wave @ shift)) ** 2 for w, wave, p in misfits) / max(len(misfits) - 2, 1)
    return float(shift[0]), float(shift[1]), math.sqrt(max(left_over * inverse[0, 0], 0.0))
