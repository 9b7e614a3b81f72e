"""The surface that a point lies on: the plane of the strip's disparities about it, and which pixels belong to it."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from vergence_metric.disparity.fovea_pair import Strip
from vergence_metric.disparity.strip_matching import DisparityPatch

_TOLERANCE_PX = 0.75
_TOLERANCE_PER_PX = 0.03  # surfaces bend: further out more is allowed
_NEAR_PX = 8
_NEAR_SIGMA_PX = 4.0
_FEWEST = 12
_ROUNDS = 3
_SCATTER_PX = 0.3  # of semi-global disparities about their plane: what lies further off counts less
_SLOPE_PRIOR = np.diag([1e-6, 2.0, 2.0])
_STEEPEST = 0.3


@dataclass(frozen=True)
class OwnSurface:
    """The surface at a point: disparity [px], its slopes across and down, and which pixels lie on it (1, else 0)."""

    disparity_px: float
    slope_x: float
    slope_y: float
    support: Strip

    def share(self, half_px: int) -> float:
        """Return the share of the pixels in the square about the point that lie on the surface."""
        middle = self.support.grey.shape[0] // 2
        about = slice(middle - half_px, middle + half_px + 1)
        return float(self.support.grey[about, about].mean())


def own_surface(patch: DisparityPatch, at: tuple[int, int], d: float, radius: int) -> OwnSurface:
    """Fit the plane about a point to the strip's disparities near `d`, robustly.

    Args:
        patch: full-resolution disparities about the point.
        at: (x, y) of the point.
        d: the disparity that the point is supposed to have [px].
        radius: half side of the support returned [px], larger where the patch is.

    Returns:
        The surface; slopes are 0 and the disparity is `d` where too few pixels lie on it.

    """
    values, around = patch.disparity_px, _surroundings(patch.disparity_px.shape, (patch.x0 - at[0], patch.y0 - at[1]))
    plane = _plane(values, around, d)
    fits = np.abs(values - (plane[0] + plane[1] * around.u + plane[2] * around.v)) <= around.tolerance
    radius = max(radius, around.reach)
    weights = np.zeros((2 * radius + 1, 2 * radius + 1), np.float32)
    top, first = patch.y0 - at[1] + radius, patch.x0 - at[0] + radius
    weights[top : top + values.shape[0], first : first + values.shape[1]] = fits
    return OwnSurface(*plane, Strip(weights, at[0] - radius, at[1] - radius))


@dataclass(frozen=True)
class _Surroundings:
    """The pixels (h, w) about a point, whatever they show.

    `u` (1, w), `v` (h, 1) are their offsets from the point [px], `tolerance` (h, w) is how far their disparities may be
    off the plane of its surface [px], `reach` the largest offset. `box` are the rows and columns nearest to the point,
    `design` (3, n) and `weights` (n) those of a plane through their n pixels.
    """

    u: NDArray[np.float32]
    v: NDArray[np.float32]
    tolerance: NDArray[np.floating]
    reach: int
    box: tuple[slice, slice]
    design: NDArray[np.float64]
    weights: NDArray[np.float64]


@lru_cache(maxsize=8)
def _surroundings(shape: tuple[int, ...], first: tuple[int, int]) -> _Surroundings:
    """Return the surroundings of a point in a patch (h, w) whose first pixel has the offset `first`."""
    u = (np.arange(shape[1]) + first[0])[None, :].astype(np.float32)
    v = (np.arange(shape[0]) + first[1])[:, None].astype(np.float32)
    tolerance = _TOLERANCE_PX + _TOLERANCE_PER_PX * np.sqrt(u * u + v * v)
    rows, columns = np.flatnonzero(np.abs(v[:, 0]) <= _NEAR_PX), np.flatnonzero(np.abs(u[0]) <= _NEAR_PX)
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    x, y = (np.broadcast_to(c, shape)[box].astype(np.float64) for c in (u, v))
    weights = np.exp(-0.5 * (x * x + y * y) / _NEAR_SIGMA_PX**2)
    reach = max(round(float(np.abs(c).max())) for c in (u, v))
    return _Surroundings(u, v, tolerance, reach, box, np.stack([np.ones_like(x), x, y]).reshape(3, -1), weights.ravel())


def _plane(values: NDArray[np.float32], around: _Surroundings, d: float) -> tuple[float, float, float]:
    """Return the plane of the disparities near `d`: at the point, and its slopes across and down."""
    near = values[around.box]
    mine = np.flatnonzero(np.abs(near - d) <= around.tolerance[around.box])
    if mine.size < _FEWEST:
        return d, 0.0, 0.0
    observed, design = near.ravel()[mine].astype(np.float64), around.design.take(mine, axis=1)
    prior = window = around.weights[mine]
    found = _weighted_plane(design, observed, window)
    for _ in range(_ROUNDS - 1):
        window = prior / (1.0 + np.square((observed - np.einsum("i,in->n", found, design)) / _SCATTER_PX))
        found = _weighted_plane(design, observed, window)
    level, *slopes = found.tolist()
    across, down = (min(max(slope, -_STEEPEST), _STEEPEST) for slope in slopes)
    return level, across, down


def _weighted_plane(
    design: NDArray[np.float64], observed: NDArray[np.float64], window: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the least-squares plane (3,) of disparities (n,) weighted by `window`, with a prior of no slope."""
    weighted = design * window
    normal = np.einsum("in,jn->ij", weighted, design) + _SLOPE_PRIOR
    return np.linalg.solve(normal, np.einsum("in,n->i", weighted, observed))
