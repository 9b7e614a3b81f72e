"""One robust bundle adjustment over head, joints' deviations and points: Levenberg and Marquardt's method.

Points are eliminated by their Schur complement, so that each step solves for the head and the deviations only (Triggs
et al., Bundle Adjustment, a Modern Synthesis, 2000). Residuals are weighed as errors of a Student distribution, whose
scale is estimated along: wrong matches lose their weight.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from vergence_calibration.geometry.unknowns import NAMES, Prior
from vergence_calibration.geometry.views import HeadViews, Observations, Points, moved

Array = npt.NDArray[np.float64]

_FREEDOM = 4.0
_INVERSE_MEAN, _INVERSE_SIGMA = 0.5, 2.0  # of a point's inverse distance [1/m]: rooms, and what is near
_STEPS = 60
_LEAST_SCALE_PX = 0.02
_CONVERGED = 1e-5  # of the cost, relative
_BEHIND_PX = 1e3
_SHARED_ERRORS = 6.5  # factor on the variance of sightings, fitted on rendered rooms: of one patch, of one lens
_FIRST_DAMPING, _MOST_DAMPING = 1e-3, 1e8


@dataclass(frozen=True)
class Constraint:
    """A further thing known of the head: residuals (K,) of the vector of unknowns, in their standard deviations."""

    residuals: Callable[[Array], Array]


@dataclass(frozen=True)
class Solution:
    """The estimate.

    vector: the unknowns, NAMES first.
    covariance: (G, G) of the NAMES; 0 for those that are held.
    residuals_px: (N,) lengths of the residuals.
    weights: (N,) of the observations, 1 for those that fit exactly.
    scale_px: scale of the residuals of the matches that agree, of one coordinate.
    """

    vector: Array
    points: Points
    covariance: Array
    residuals_px: Array
    weights: Array
    scale_px: float


@dataclass(frozen=True)
class _System:
    cost: float
    residuals_px: Array
    weights: Array
    camera_block: Array
    point_blocks: Array
    mixed: Array
    camera_slope: Array
    point_slope: Array


class BundleAdjustment:
    """Of one set of observations; `constraints` add to the prior. With `points_only` the head is the prior's mean."""

    def __init__(
        self,
        views: HeadViews,
        seen: Observations,
        prior: Prior,
        constraints: tuple[Constraint, ...] = (),
        points_only: bool = False,
    ) -> None:
        self._views, self._prior, self._constraints = views, prior, constraints
        order = np.argsort(seen.view, kind="stable")
        self._order = order
        self._seen = Observations(seen.view[order], seen.point[order], seen.pixels[order])
        self._ends = np.searchsorted(self._seen.view, np.arange(views.count + 1))
        self._count = int(seen.point.max()) + 1
        estimated = np.concatenate([prior.sigmas > 0, np.ones(views.size - len(NAMES), bool)])
        self._free = np.flatnonzero(estimated & (not points_only))
        self._means = np.concatenate([prior.means, np.zeros(views.size - len(NAMES))])

    def start(self) -> tuple[Array, Points]:
        """Return the unknowns of the prior, and points half-way between near and far along their mean rays."""
        vector = self._means.copy()
        rays = self._views.rays(vector, self._seen)
        sums = np.column_stack([np.bincount(self._seen.point, rays[:, k], self._count) for k in range(3)])
        directions = sums / np.linalg.norm(sums, axis=1, keepdims=True)
        return vector, Points(directions, np.full(self._count, _INVERSE_MEAN))

    def solve(self, vector: Array, points: Points) -> Solution:
        """Return the estimate that is reached from a start."""
        scale_px = self._robust_scale(vector, points)
        damping, system = _FIRST_DAMPING, self._system(vector, points, scale_px)
        for _ in range(_STEPS):
            accepted = False
            while not accepted and damping < _MOST_DAMPING:
                step, steps = self._step(system, damping)
                tried, tried_points = vector.copy(), moved(points, steps)
                tried[self._free] += step
                cost = self._cost(tried, tried_points, scale_px)
                accepted = cost < system.cost
                damping = max(0.2 * damping, 1e-9) if accepted else 8.0 * damping
            if not accepted:
                break
            gained = (system.cost - cost) / system.cost
            vector, points = tried, tried_points
            system = self._system(vector, points, scale_px)
            scale_was_px, scale_px = scale_px, self._scale(system)
            settled = gained < _CONVERGED and abs(scale_px / scale_was_px - 1.0) < 1e-3
            system = self._system(vector, points, scale_px)
            if settled:
                break
        residuals_px, weights = np.empty_like(system.residuals_px), np.empty_like(system.weights)
        residuals_px[self._order], weights[self._order] = system.residuals_px, system.weights
        covariance = self._covariance(system)
        return Solution(vector, points, covariance, residuals_px, weights, scale_px)

    def _priors(self) -> Array:
        """Return 1 / standard deviation of every unknown; 0 for those that are held."""
        sigmas = np.concatenate(
            [self._prior.sigmas, np.tile(self._prior.joint_sigma_rad, len(self._views.poses.joints_rad))]
        )
        return np.divide(1.0, sigmas, out=np.zeros_like(sigmas), where=sigmas > 0)

    def _differences(self, pixels: Array) -> Array:
        return np.nan_to_num(pixels - self._seen.pixels, nan=_BEHIND_PX)

    def _robust_scale(self, vector: Array, points: Points) -> float:
        pixels, _, _ = self._views.project(vector, points, self._seen)
        return max(1.4826 * float(np.median(np.abs(self._differences(pixels)))), _LEAST_SCALE_PX)

    def _scale(self, system: _System) -> float:
        """Return the scale of highest likelihood under the weights of the last one, of one coordinate."""
        spread = (_FREEDOM + 2.0) / _FREEDOM * system.weights * system.residuals_px**2
        return max(math.sqrt(0.5 * float(np.mean(spread))), _LEAST_SCALE_PX)

    def _known(self, vector: Array, points: Points) -> float:
        away = (vector - self._means) * self._priors()
        far = (points.inverse_m - _INVERSE_MEAN) / _INVERSE_SIGMA
        others = sum(float(np.sum(c.residuals(vector) ** 2)) for c in self._constraints)
        return float(away @ away + far @ far) + others

    def _cost(self, vector: Array, points: Points, scale_px: float) -> float:
        pixels, _, _ = self._views.project(vector, points, self._seen)
        return self._misfit(self._differences(pixels), scale_px) + self._known(vector, points)

    @staticmethod
    def _misfit(differences: Array, scale_px: float) -> float:
        ratio = (differences**2).sum(axis=1) / scale_px**2
        return float(np.sum((_FREEDOM + 2.0) * np.log1p(ratio / _FREEDOM)))

    def _system(self, vector: Array, points: Points, scale_px: float) -> _System:
        pixels, by_view, by_point = self._views.project(vector, points, self._seen)
        behind = np.isnan(pixels[:, 0])
        by_view[behind], by_point[behind] = 0.0, 0.0
        differences = self._differences(pixels)
        square = (differences**2).sum(axis=1)
        weights = (_FREEDOM + 2.0) / (_FREEDOM + square / scale_px**2)
        root = np.sqrt(weights)[:, None] / scale_px
        residuals, by_view, by_point = root * differences, root[:, :, None] * by_view, root[:, :, None] * by_point
        size, seen = self._views.size, self._seen
        block, slope = np.zeros((size, size)), np.zeros(size)
        mixed = np.zeros((size, self._count, 3))
        for view in range(self._views.count):
            mine = slice(self._ends[view], self._ends[view + 1])
            places = self._views.unknowns[view]
            jacobian = by_view[mine].reshape(-1, len(places))
            block[np.ix_(places, places)] += jacobian.T @ jacobian
            slope[places] += jacobian.T @ residuals[mine].ravel()
            mixed[places[:, None], seen.point[mine]] += np.einsum("nij,nik->jnk", by_view[mine], by_point[mine])
        point_blocks = np.zeros((self._count, 3, 3))
        point_slope = np.zeros((self._count, 3))
        squares = np.einsum("nij,nik->njk", by_point, by_point)
        slopes = np.einsum("nij,ni->nj", by_point, residuals)
        for i in range(3):
            point_slope[:, i] = np.bincount(seen.point, slopes[:, i], self._count)
            for j in range(3):
                point_blocks[:, i, j] = np.bincount(seen.point, squares[:, i, j], self._count)
        point_blocks[:, 2, 2] += _INVERSE_SIGMA**-2
        point_slope[:, 2] += (points.inverse_m - _INVERSE_MEAN) * _INVERSE_SIGMA**-2
        precise = self._priors() ** 2
        block[np.diag_indices(size)] += precise
        slope += precise * (vector - self._means)
        for constraint in self._constraints:
            here, jacobian = constraint.residuals(vector), _numeric(constraint.residuals, vector)
            block += jacobian.T @ jacobian
            slope += jacobian.T @ here
        cost = self._misfit(differences, scale_px) + self._known(vector, points)
        free = self._free
        return _System(
            cost,
            np.sqrt(square),
            weights * _FREEDOM / (_FREEDOM + 2.0),
            block[np.ix_(free, free)],
            point_blocks,
            mixed[free].reshape(len(free), 3 * self._count),
            slope[free],
            point_slope,
        )

    def _reduced(self, system: _System, damping: float) -> tuple[Array, Array, Array]:
        """Return the Schur complement, and the inverse point blocks (M, 3, 3) and the mixed block times them."""
        diagonal = np.arange(3)
        blocks = system.point_blocks.copy()
        blocks[:, diagonal, diagonal] *= 1.0 + damping
        blocks[:, diagonal, diagonal] += 1e-9
        inverse = np.asarray(np.linalg.inv(blocks), np.float64)
        mixed = system.mixed.reshape(len(system.mixed), self._count, 3)
        product = np.einsum("dmi,mij->dmj", mixed, inverse).reshape(system.mixed.shape)
        block = system.camera_block + damping * np.diag(np.diag(system.camera_block))
        return block - product @ system.mixed.T, inverse, product

    def _step(self, system: _System, damping: float) -> tuple[Array, Array]:
        reduced, inverse, product = self._reduced(system, damping)
        slope = system.camera_slope - product @ system.point_slope.ravel()
        step = -np.asarray(np.linalg.solve(reduced, slope), np.float64)
        rest = system.point_slope + (step @ system.mixed).reshape(-1, 3)
        return step, -np.einsum("mij,mj->mi", inverse, rest)

    def _covariance(self, system: _System) -> Array:
        """Return the covariance of the NAMES, with errors of the sightings that are shared between them."""
        reduced, _, _ = self._reduced(system, 0.0)
        known = np.diag(self._priors()[self._free] ** 2)
        reduced = (reduced - known) / _SHARED_ERRORS + known
        full = np.zeros((self._views.size, self._views.size))
        full[np.ix_(self._free, self._free)] = np.linalg.inv(reduced)
        return full[: len(NAMES), : len(NAMES)]


def _numeric(function: Callable[[Array], Array], vector: Array) -> Array:
    """Return the Jacobian of a function of the NAMES."""
    jacobian = np.zeros((len(function(vector)), len(vector)))
    for place in range(len(NAMES)):
        step = np.zeros(len(vector))
        step[place] = 1e-6
        jacobian[:, place] = (function(vector + step) - function(vector - step)) / 2e-6
    return jacobian
