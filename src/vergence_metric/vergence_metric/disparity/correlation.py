"""Windowed normalised cross-correlation of one point against a range of shifts, and its uncertainty.

The window is Gaussian, so that the point itself counts most. Correlation is invariant to gain and offset.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import Strip

REACH_IN_SIGMAS = 2.5
"""Windows are cut off at this many standard deviations; beyond lies 1 % of the weight."""

_NOISE_GAIN = math.sqrt(math.pi / 2) / 6  # Immerkaer, "Fast noise variance estimation", 1996
_LAPLACIAN = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)


def radius_of(sigma: float) -> int:
    """Return the window's radius in pixels."""
    return math.ceil(REACH_IN_SIGMAS * sigma)


@lru_cache(maxsize=32)
def _line(sigma: float) -> NDArray[np.float32]:
    """Return the Gaussian in one dimension as (n, 1); it sums to 1."""
    radius = radius_of(sigma)
    line = np.exp(-0.5 * (np.arange(-radius, radius + 1) / sigma) ** 2)
    return (line / line.sum())[:, None].astype(np.float32)


@lru_cache(maxsize=32)
def _window(across: float, down: float) -> NDArray[np.float32]:
    """Return the Gaussian in two dimensions, (rows, columns); it sums to 1."""
    return np.asarray(_line(down) @ _line(across).T, np.float32)


@lru_cache(maxsize=32)
def _columns(sigma: float, rows: int) -> NDArray[np.float32]:
    """Return the matrix (rows - 2 * radius, rows) that filters columns by the Gaussian, where all of it is inside."""
    line, radius = _line(sigma)[:, 0], radius_of(sigma)
    matrix = np.zeros((rows - 2 * radius, rows), np.float32)
    for row in range(len(matrix)):
        matrix[row, row : row + len(line)] = line
    return matrix


def _windowed_mean(strip: NDArray[np.float32], across: float, down: float) -> NDArray[np.float32]:
    """Return the weighted mean of the window about every pixel of a strip (h, w) whose window is inside.

    A strip is little higher than a window: columns first, only where a window fits, is a fifth of the work of a filter
    of the whole strip. The product is too small for BLAS to use threads.
    """
    radius = radius_of(across)
    filtered = cv2.filter2D(_columns(down, strip.shape[0]) @ strip, cv2.CV_32F, _line(across).T)
    return np.asarray(filtered[:, radius:-radius], np.float32)


def _sum(weights: NDArray[np.float32], values: NDArray[np.float32]) -> float:
    """Return the weighted sum of two arrays of one shape."""
    return float(np.einsum("ij,ij->", weights, values))


def _mean(values: NDArray[np.float32]) -> float:
    """Return the mean of an array, some microseconds sooner than its own method."""
    return float(np.add.reduce(values, axis=None) / values.size)


@dataclass(frozen=True)
class Texture:
    """What the window about a point holds.

    `deviation` is the weighted standard deviation of the grey values, `noise` that of the pixel noise in it (both in
    grey levels), `independent` the number of independent samples: the window's area over the texture's correlation
    area, both as standard deviations of Gaussians. `length` is the texture's correlation length across [px].
    """

    deviation: float
    noise: float
    independent: float
    length: float

    @property
    def signal(self) -> float:
        """Standard deviation of the texture without the noise, in grey levels."""
        return math.sqrt(max(self.deviation**2 - self.noise**2, 0.0))


@dataclass(frozen=True)
class Surface:
    """Correlation against shifts: `zncc[j, i]` belongs to vertical disparity first_v + j, horizontal first_d + i."""

    zncc: NDArray[np.float32]
    first_d: int
    first_v: int
    texture: Texture

    @property
    def profile(self) -> NDArray[np.float32]:
        """The best correlation over vertical disparity, for each horizontal one."""
        return self.zncc.max(axis=0)

    def peak_near(self, d: float, tolerance: int) -> tuple[int, int, float]:
        """Return (i, j, correlation) of the best shift whose horizontal disparity is within tolerance of d."""
        width = self.zncc.shape[1]
        low = min(max(round(d) - self.first_d - tolerance, 0), width - 1)
        high = min(max(round(d) - self.first_d + tolerance + 1, low + 1), width)
        part = self.zncc[:, low:high]
        j, i = divmod(int(part.argmax()), high - low)
        return low + i, j, float(part[j, i])

    def subpixel(self, i: int, j: int) -> tuple[float, float]:
        """Return (horizontal, vertical) disparity of the peak at column i, row j by a parabola in each direction."""
        di, dj = peak_offset(self.zncc, i, j)
        return self.first_d + i + di, self.first_v + j + dj


def peak_offset(surface: NDArray[np.float32], i: int, j: int) -> tuple[float, float]:
    """Return the sub-pixel offset (x, y) of the peak at column i, row j by a parabola each way; 0 at a border."""
    rows, columns = surface.shape
    across = parabola(surface[j, i - 1], surface[j, i], surface[j, i + 1]) if 0 < i < columns - 1 else 0.0
    down = parabola(surface[j - 1, i], surface[j, i], surface[j + 1, i]) if 0 < j < rows - 1 else 0.0
    return across, down


def parabola(before: float, at: float, after: float) -> float:
    """Return the offset in -0.5..0.5 of the maximum from the middle one of three values a pixel apart."""
    bend = float(before) - 2.0 * float(at) + float(after)
    return 0.0 if bend >= -1e-9 else float(np.clip(0.5 * (float(before) - float(after)) / bend, -0.5, 0.5))


def texture_of(patch: NDArray[np.float32], across: float, down: float) -> Texture:
    """Measure the texture of a window's patch; its sides are 2 * radius_of(sigma) + 1 of the sigma in their way."""
    weights = _window(across, down)
    centred = patch - _sum(weights, patch)
    variance = _sum(weights, centred * centred)
    # Strong texture raises Immerkaer's mean of absolute values; the median only follows what most pixels do.
    residual = np.abs(cv2.filter2D(patch, cv2.CV_32F, _LAPLACIAN)[1:-1, 1:-1]).ravel()
    middle = residual.size // 2  # of an odd number: np.median without its checks, which take longer than the sorting
    median = float(np.partition(residual, middle)[middle])
    noise = min(1.4826 * median / 6.0, _NOISE_GAIN * _mean(residual))
    gx, gy = patch[:, 2:] - patch[:, :-2], patch[2:] - patch[:-2]
    # White noise of deviation s adds s^2/2 to the squared central difference, half of what is taken here.
    floor = 1e-6
    squares = _sum(weights[:, 1:-1], gx * gx), _sum(weights[1:-1], gy * gy)
    along = [max(square / 4.0 - noise**2 / 2, floor) for square in squares]
    signal = max(variance - noise**2, floor)
    sigmas = across, down
    lengths = [min(max(math.sqrt(signal / g), 1.0), 2.0 * sigma) for g, sigma in zip(along, sigmas, strict=True)]
    independent = 4.0 * across * down / (lengths[0] * lengths[1])
    return Texture(math.sqrt(variance), noise, independent, lengths[0])


def texture_about(source: Strip, at: tuple[int, int], sigma: float) -> Texture:
    """Measure the texture of the window about a point (x, y) at the strip's resolution."""
    radius = radius_of(sigma)
    return texture_of(_patch(source, at, radius, radius), sigma, sigma)


def _patch(source: Strip, at: tuple[int, int], across: int, down: int) -> NDArray[np.float32]:
    x, y = at[0] - int(source.x0), at[1] - int(source.y0)
    return source.grey[y - down : y + down + 1, x - across : x + across + 1]


def correlate(
    source: Strip,
    other: Strip,
    at: tuple[int, int],
    sigma: float,
    d_range: tuple[int, int],
    v_range: tuple[int, int],
    sign: int = -1,
    down: float = 0.0,
    texture: Texture | None = None,
) -> Surface:
    """Correlate the window about a point of one eye with the other eye's, for every whole shift in a range.

    Args:
        source: the eye whose point is asked for.
        other: the eye that is searched.
        at: (x, y) of the point in `source`, at the strips' resolution.
        sigma: of the Gaussian window, in pixels of this resolution; across, if there is one for the way down.
        d_range: first and last horizontal disparity, inclusive.
        v_range: first and last vertical disparity, inclusive.
        sign: -1 from left to right (x_right = x_left - d), +1 from right to left.
        down: of the window in the way down; 0 for one as high as wide.
        texture: of the window, where it is known already.

    Returns:
        Surface of shape (v_last - v_first + 1, d_last - d_first + 1).

    """
    down = down or sigma
    rx, ry, weights = radius_of(sigma), radius_of(down), _window(sigma, down)
    patch = _patch(source, at, rx, ry)
    texture = texture or texture_of(patch, sigma, down)
    kernel = weights * (patch - _sum(weights, patch))

    xs = sorted(at[0] + sign * d for d in d_range)
    ys = sorted(at[1] + sign * v for v in v_range)
    top, first = ys[0] - int(other.y0) - ry, xs[0] - int(other.x0) - rx
    strip = other.grey[top : ys[1] - int(other.y0) + ry + 1, first : xs[1] - int(other.x0) + rx + 1]
    strip = strip - _mean(strip)  # keeps the float32 sum of squares exact enough
    product = cv2.matchTemplate(strip, kernel, cv2.TM_CCORR)
    mean, square = _windowed_mean(strip, sigma, down), _windowed_mean(strip * strip, sigma, down)
    # One grey level squared on both sides: flat areas correlate to nothing instead of to noise.
    variance = np.maximum(square - mean * mean, 0.0) + 1.0
    zncc = product / np.sqrt(variance * (texture.deviation**2 + 1.0))
    if sign < 0:
        zncc = zncc[::-1, ::-1]
    return Surface(np.ascontiguousarray(zncc), d_range[0], v_range[0], texture)
