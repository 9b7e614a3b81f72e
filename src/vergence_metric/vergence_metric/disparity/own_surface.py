"""The surface that a point lies on: the plane of the strip's disparities about it, and which pixels belong to it."""

from dataclasses import dataclass

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
_SLOPE_PRIOR = np.array([1e-6, 2.0, 2.0])
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
    values = patch.disparity_px
    h, w = values.shape
    u = (np.arange(w) + patch.x0 - at[0])[None, :].astype(np.float32)
    v = (np.arange(h) + patch.y0 - at[1])[:, None].astype(np.float32)
    tolerance = _TOLERANCE_PX + _TOLERANCE_PER_PX * np.sqrt(u * u + v * v)
    plane = _plane(values, u, v, d, tolerance)
    fits = np.abs(values - (plane[0] + plane[1] * u + plane[2] * v)) <= tolerance
    radius = max(radius, round(float(np.abs(u).max())), round(float(np.abs(v).max())))
    weights = np.zeros((2 * radius + 1, 2 * radius + 1), np.float32)
    top, first = patch.y0 - at[1] + radius, patch.x0 - at[0] + radius
    weights[top : top + h, first : first + w] = fits
    return OwnSurface(*plane, Strip(weights, at[0] - radius, at[1] - radius))


def _plane(
    values: NDArray[np.float32],
    u: NDArray[np.float32],
    v: NDArray[np.float32],
    d: float,
    tolerance: NDArray[np.floating],
) -> tuple[float, float, float]:
    rows, columns = np.flatnonzero(np.abs(v[:, 0]) <= _NEAR_PX), np.flatnonzero(np.abs(u[0]) <= _NEAR_PX)
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    near = values[box]
    mine = np.abs(near - d) <= tolerance[box]
    if np.count_nonzero(mine) < _FEWEST:
        return d, 0.0, 0.0
    x, y = (np.broadcast_to(c, values.shape)[box][mine].astype(np.float64) for c in (u, v))
    observed = near[mine].astype(np.float64)
    design = np.stack([np.ones_like(x), x, y])
    prior = window = np.exp(-0.5 * (x * x + y * y) / _NEAR_SIGMA_PX**2)
    for _ in range(_ROUNDS):
        weighted = design * window
        normal = np.einsum("in,jn->ij", weighted, design) + np.diag(_SLOPE_PRIOR)
        found = np.linalg.solve(normal, np.einsum("in,n->i", weighted, observed))
        window = prior / (1.0 + np.square((observed - np.einsum("i,in->n", found, design)) / _SCATTER_PX))
    slopes = np.clip(found[1:], -_STEEPEST, _STEEPEST)
    return float(found[0]), float(slopes[0]), float(slopes[1])
