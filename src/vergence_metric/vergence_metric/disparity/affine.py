"""Disparity refined by a model that includes rotation, slant and gain: robust to real mounts.

Gauss-Newton in the inverse compositional form (Baker and Matthews, "Lucas-Kanade 20 years on", 2004): the right image,
warped, is a linear function of the left one, its gradients times the affine increments, gain and offset, all solved
together; the normal matrix depends on the left image alone and is factored once.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.correlation import radius_of
from vergence_metric.disparity.fovea_pair import FoveaPair, Strip
from vergence_metric.disparity.parameters import DisparityParameters
from vergence_metric.disparity.search import Match
from vergence_metric.disparity.shared_search import LocalDisparity

_BLUR_PX = 0.9  # linear interpolation is all but exact on what this leaves
_REMAP_STEPS = 32  # per pixel
_ITERATIONS = 12
_CONVERGED_PX = 0.01
_LARGEST_STEP_PX = 3.0
_LARGEST_SHEAR = 0.4
_LARGEST_LEAP_PX = 8.0
_LEAST_GAIN = 0.2
_LEAST_VARIANCE = 1e-3  # grey levels squared
_LEAST_SUPPORT = 0.05  # share of a window's weight that must lie on the surface
_SHEAR_FROM_PX = 8.0
_REACH_PX = 24  # that a warped window may reach beyond its own size
_FLOOR_PX = 0.01  # interpolation, and what no residual shows
_BLOCK_PX = 7
_SPARSE_FROM_PX = 16.0  # windows of this deviation or more: every second row and column of the blurred image is enough
_MIXED_PX = 0.07  # what the model misses of surfaces that end or bend within sight, by scenes of the simulator
_DRIFT_SHARE = 0.7  # what an answer moves by when its window grows, noise does not explain
_PRIOR_SHEAR = 0.1  # standard deviation of slant and roll between the eyes
_PRIOR_VERTICAL_PX = 1.0

Matrix = NDArray[np.float64]
Samples = NDArray[np.float32]
Warp = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Two rows: the linear part's two columns, and the translation [px]."""


@dataclass(frozen=True)
class Fit:
    """A fitted warp: disparity at the point [px], its deviation [px], what is left over [grey levels], linear part.

    `texture` is the deviation of the left image's grey levels under the window's weights.
    """

    horizontal_px: float
    vertical_px: float
    sigma_px: float
    residual: float
    affine: Matrix
    texture: float

    @property
    def correlation(self) -> float:
        """Correlation of the left image with the warped right one under the window's weights."""
        return math.sqrt(max(1.0 - (self.residual / max(self.texture, 1e-3)) ** 2, 0.0))


def measure_affine(pair: FoveaPair, match: Match, parameters: DisparityParameters) -> LocalDisparity | None:
    """Return the disparity by the affine fit about a match; None where it does not converge."""
    fit = grow(pair, match.horizontal_px, match.vertical_px, match.window_px, parameters)
    return None if fit is None else LocalDisparity(fit.horizontal_px, fit.vertical_px, fit.sigma_px)


def grow(
    pair: FoveaPair,
    horizontal_px: float,
    vertical_px: float,
    window_px: float,
    parameters: DisparityParameters,
    slopes: tuple[float, float] = (0.0, 0.0),
    support: Strip | None = None,
) -> Fit | None:
    """Fit in the window that decided, then in larger ones while they see the same surface; None if nothing fits.

    `slopes` are the disparity's changes per pixel across and down, where they are known. `support` weights the pixels
    of the left image from 0 to 1, such as 0 for those of another surface.
    """
    reach = radius_of(parameters.windows_px[-1]) + _REACH_PX
    x, blurred = pair.point_px[0], []
    for strip, middle in zip(pair.full, (x, x - horizontal_px), strict=True):
        near = strip.columns(round(middle) - reach, round(middle) + reach + 1)
        blurred.append(Strip(cv2.GaussianBlur(near.grey, (0, 0), _BLUR_PX), near.x0, near.y0))
    warp = np.array([[1.0 - slopes[0], -slopes[1], -horizontal_px], [0.0, 1.0, -vertical_px]])
    best: Fit | None = None
    for sigma in [w for w in parameters.windows_px if w >= window_px]:
        fit = fit_affine(blurred[0], blurred[1], pair.point_px, sigma, warp, support)
        # The same surface leaves the same residual; another depth in view raises it.
        if (
            fit is None
            or abs(fit.horizontal_px - horizontal_px) > _LARGEST_STEP_PX
            or (best is not None and fit.residual > 1.25 * best.residual + 0.5)
        ):
            return best and replace(best, sigma_px=math.hypot(best.sigma_px, _MIXED_PX))
        if best is not None:
            drift_px = _DRIFT_SHARE * (fit.horizontal_px - best.horizontal_px)
            fit = replace(fit, sigma_px=math.hypot(fit.sigma_px, drift_px))
        best, warp = fit, np.column_stack([fit.affine, [-fit.horizontal_px, -fit.vertical_px]])
    return best


def fit_affine(
    left: Strip,
    right: Strip,
    point_px: tuple[float, float],
    sigma: float,
    warp: Matrix,
    support: Strip | None = None,
) -> Fit | None:
    """Fit the warp from offsets about the point in the left image to offsets in the right one.

    Args:
        left: the left strip, slightly blurred.
        right: the right strip, blurred the same way.
        point_px: (x, y) of the point in the left image.
        sigma: of the Gaussian window [px].
        warp: (2, 3), where to start: linear part and translation (-disparity).
        support: weights of the left image's pixels, 0 to 1, as large as the window at least; None for all alike.

    Returns:
        The fit, None where it does not converge or texture does not determine it.

    """
    window = _linearised(left, point_px, sigma, support)
    if window is None:
        return None
    (a, b, x), (c, d, y) = warp.tolist()
    gain = 1.0
    for _ in range(_ITERATIONS):
        seen = window.seen(right, point_px, ((a, b, x), (c, d, y)), gain)
        solution = window.solution(seen)
        gain = float(solution[6])
        if not _LEAST_GAIN <= gain <= 1.0 / _LEAST_GAIN:
            return None
        step = [value / gain for value in solution[:6].tolist()]
        (e, f, g), (h, i, j) = _undone(step, sigma)
        a, b, x, c, d, y = (
            a * e + b * h,
            a * f + b * i,
            a * g + b * j + x,
            c * e + d * h,
            c * f + d * i,
            c * g + d * j + y,
        )
        sheared = max(abs(a - 1.0), abs(b), abs(c), abs(d - 1.0)) > _LARGEST_SHEAR
        if sheared or max(abs(step[0]), abs(step[3])) > _LARGEST_LEAP_PX:
            return None
        if max(map(abs, step)) < _CONVERGED_PX:
            break
    weighted = window.weighted_residual(seen, solution)
    sigma_px = math.hypot(window.deviation(weighted) / gain, _FLOOR_PX)
    residual = math.sqrt(float(np.square(weighted).sum()))
    return Fit(-x, -y, sigma_px, residual, np.array([[a, b], [c, d]]), window.texture)


@dataclass(frozen=True)
class _Window:
    """The left image about the point as a linear model of six affine increments, gain and offset.

    Of its N = n x n samples, `stride_px` apart, `offsets` are u (1, n) and v (n, 1) from the point [px], `gradients`
    (2, n, n) those across and down, `roots` (N) those of the weights, which sum to 1, `weighted` (8, N) is their
    product with the model's parts and `inverse` (8, 8) that of the normal matrix; `texture` is the weighted deviation
    of the grey levels. What has an entry for each sample is float32.
    """

    stride_px: int
    offsets: tuple[Samples, Samples]
    gradients: Samples
    roots: Samples
    weighted: Samples
    inverse: Matrix
    texture: float

    @cached_property
    def _buffers(self) -> tuple[Samples, Samples]:
        """Arrays as large as `gradients` that every iteration reuses."""
        return np.empty_like(self.gradients), np.empty_like(self.gradients)

    def seen(self, right: Strip, point_px: tuple[float, float], warp: Warp, gain: float) -> Samples:
        """Return what the right image shows at the warped offsets, weighted (N)."""
        # remap of OpenCV 4 rounds to a grid, that of OpenCV 5 does not: round first, make good what that misses.
        steps, maps = self._buffers
        (u, v), first = self.offsets, (right.x0, right.y0)
        for i, (across, down, shift) in enumerate(warp):
            fixed = (_REMAP_STEPS * down) * v + np.float32(_REMAP_STEPS * (shift + point_px[i] - first[i]))
            np.add((_REMAP_STEPS * across) * u, fixed, out=steps[i])
        np.rint(steps, out=maps)
        steps -= maps
        maps *= np.float32(1.0 / _REMAP_STEPS)
        sampled = cv2.remap(right.grey, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        steps *= self.gradients
        seen = steps[0] + steps[1]
        seen *= np.float32(gain / _REMAP_STEPS)
        seen += sampled
        weighted = seen.ravel()
        weighted *= self.roots
        return weighted

    def solution(self, seen: Samples) -> Matrix:
        """Return the model's parameters (8): the increments times the gain, gain and offset."""
        return np.asarray(self.inverse @ np.einsum("in,n->i", self.weighted, seen))

    def weighted_residual(self, seen: Samples, solution: Matrix) -> Samples:
        """Return what the model leaves of what is seen, weighted (N)."""
        return np.asarray(seen - np.einsum("i,in->n", solution.astype(np.float32), self.weighted))

    def deviation(self, weighted_residual: Samples) -> float:
        """Return the standard deviation of the horizontal translation [px, times gain] by the residuals (N).

        Residuals correlate between neighbouring pixels (blur, edges, unmodelled depth): their effect is summed in
        blocks before it is squared, as in estimates consistent under autocorrelation (Newey and West, 1987).
        """
        effect = weighted_residual * np.einsum("i,in->n", self.inverse[0].astype(np.float32), self.weighted)
        effect = effect.reshape(self.gradients.shape[1:])
        side = -(-_BLOCK_PX // self.stride_px)
        blocks = cv2.boxFilter(effect, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT)
        return math.sqrt(float(np.square(blocks).sum())) / side


def _linearised(
    left: Strip, point_px: tuple[float, float], sigma: float, support: Strip | None = None
) -> _Window | None:
    """Return the window about the point as a linear model, None where it holds too little texture."""
    stride = 2 if sigma >= _SPARSE_FROM_PX else 1
    offsets = np.arange(-(radius_of(sigma) // stride) * stride, radius_of(sigma) + 1, stride)
    x, y = round(point_px[0] - left.x0), round(point_px[1] - left.y0)
    first, last = int(offsets[0]), int(offsets[-1])

    def shifted(right: int, down: int) -> NDArray[np.floating]:
        rows = slice(y + first + down, y + last + down + 1, stride)
        return left.grey[rows, x + first + right : x + last + right + 1 : stride]

    patch = shifted(0, 0)
    gradients = np.empty((2, *patch.shape), np.float32)
    np.subtract(shifted(1, 0), shifted(-1, 0), out=gradients[0])
    np.subtract(shifted(0, 1), shifted(0, -1), out=gradients[1])
    gradients *= 0.5
    u = (offsets + (x + left.x0 - point_px[0])).astype(np.float32)[None, :]
    v = (offsets + (y + left.y0 - point_px[1])).astype(np.float32)[:, None]
    across, down = np.exp(-0.5 * (u / sigma) ** 2), np.exp(-0.5 * (v / sigma) ** 2)
    roots = np.sqrt(down / down.sum()) * np.sqrt(across / across.sum())
    share = 1.0
    if support is not None:
        rows, columns = (round(c + first - o) for c, o in ((y + left.y0, support.y0), (x + left.x0, support.x0)))
        span = last - first + 1
        roots = roots * np.sqrt(support.grey[rows : rows + span : stride, columns : columns + span : stride])
        share = float(np.square(roots).sum())
        if share < _LEAST_SUPPORT:
            return None
        roots /= math.sqrt(share)
    centred = patch - float((roots * roots * patch).sum())
    # Offsets are scaled by the window, so that the rows of the model are of one size.
    weighted = np.empty((8, *patch.shape), np.float32)
    for part, gradient in zip((weighted[:3], weighted[3:6]), gradients, strict=True):
        np.multiply(gradient, roots, out=part[0])
        np.multiply(part[0], u / sigma, out=part[1])
        np.multiply(part[0], v / sigma, out=part[2])
    np.multiply(centred, roots, out=weighted[6])
    weighted[7] = roots
    weighted = weighted.reshape(8, -1)
    # OpenCV and einsum, not matmul: BLAS threads wait for one another whenever other nodes hold the cores.
    normal = cv2.mulTransposed(weighted.astype(np.float64), False)
    if float(normal[6, 6]) < _LEAST_VARIANCE:
        return None
    texture = math.sqrt(float(normal[6, 6]))
    normal.flat[::9] += _damping(sigma, share)
    determined, inverse = cv2.invert(normal, flags=cv2.DECOMP_CHOLESKY)
    if not determined:
        return None
    return _Window(stride, (u, v), gradients, roots.ravel(), weighted, inverse, texture)


def _damping(sigma: float, share: float) -> Matrix:
    """Return the damping of the steps (8) where texture is weak, as if by priors at a noise of 2 levels."""
    damping = np.zeros(8)
    noise = 4.0 / (2 * math.pi * sigma**2 * share)
    # A small window barely sees roll and slant, and fitting them costs it its precision: there they stay as they are.
    damping[[1, 2, 4, 5]] = noise / (_PRIOR_SHEAR * sigma) ** 2 if sigma >= _SHEAR_FROM_PX else 1e9
    damping[3] = noise / _PRIOR_VERTICAL_PX**2
    return damping


def _undone(step: list[float], sigma: float) -> Warp:
    """Return the inverse warp of an increment (6): translation across, two shears, the same three down."""
    a, b, c, d = 1 + step[1] / sigma, step[2] / sigma, step[4] / sigma, 1 + step[5] / sigma
    scale = 1.0 / (a * d - b * c)
    a, b, c, d = scale * d, -scale * b, -scale * c, scale * a
    return (a, b, -a * step[0] - b * step[3]), (c, d, -c * step[0] - d * step[3])
